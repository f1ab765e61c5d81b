"""Sums over bonds on OpenCL devices, to the same bits as those of lattices on the processor."""
