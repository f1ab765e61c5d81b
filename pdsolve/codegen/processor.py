"""The kind of processor that kernels are compiled for, which decides the last bits of sums."""

from __future__ import annotations

import numba
from llvmlite import binding


def processor_kind() -> str:
    """Name of the processor in LLVM's words, such as "znver3", or what numba is told to compile for."""
    name = numba.config.CPU_NAME or binding.get_host_cpu_name()
    return f"{name} {numba.config.CPU_FEATURES}" if numba.config.CPU_FEATURES else str(name)
