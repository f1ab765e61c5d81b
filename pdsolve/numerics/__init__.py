"""Machine support of kernels: threads, sums in a given order, memory."""
