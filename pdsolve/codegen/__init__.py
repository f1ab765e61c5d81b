"""All that knows numba's inside: vector code written in LLVM, and how kernels are compiled and stored.

vector_code       how many lanes fit into registers, and instructions of vectors
lanes             lanes as a number type of compiled functions
fused             a product and a sum in one rounding
atomics           counters that threads share
record            structs of numbers that compiled code reads and writes
inner_functions   functions that only compiled code calls
jit_cache         kernels stored on disk
kernel_sources    what a stored kernel was compiled from
compile_time      how long kernels are compiled in a command
"""
