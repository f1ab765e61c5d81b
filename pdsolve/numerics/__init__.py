"""Machine support of kernels: a cache of compiled code, and threads."""
