"""What kernels need of the machine: a cache of compiled code, and threads."""
