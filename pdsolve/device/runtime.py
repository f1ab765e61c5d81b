"""OpenCL devices: which there are, which one a run takes, its memory, its programs, and what it says when it fails.

pyopencl is an extra, and is imported by these functions alone.
"""

from __future__ import annotations

import os
import shutil
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh import trust
from pdsolve.errors import DeviceLostError
from pdsolve.model import ModelError

INSTALL = "pip install 'pdsuite[opencl]'"
DOUBLE = "cl_khr_fp64"
EXACT = "-cl-fp32-correctly-rounded-divide-sqrt"  # of single precision; double precision always is
MOST = 2**31 - 1  # numbers of an array that kernels count in 32 bits
POCL, LINKER = "Portable Computing Language", "ld"  # without which PoCL ends the process that builds a kernel
UNKNOWN = "unknown target CPU"  # PoCL of processors that are newer than its compiler
SPARE = 0.9  # of a device's memory that a run may take


class FoundDevice(NamedTuple):
    """A device of a platform."""

    number: int  # as `opencl:1` has it
    platform: str
    name: str
    kind: str  # GPU, CPU or other
    double: bool  # whether it has float64
    memory: int  # bytes
    largest: int  # array that it takes, bytes
    units: int  # compute units

    @property
    def summary(self) -> str:
        """One line of a list of devices."""
        precision = "float64 and float32" if self.double else "float32 alone"
        where = f"{self.name.strip()} ({self.kind}, {self.platform.strip()})"
        return f"opencl:{self.number}  {where}: {precision}, {self.memory / 1e9:.3g} GB, {self.units} compute units"


def devices() -> list[FoundDevice]:
    """All devices of all platforms. Raises ModelError without the package or without a runtime."""
    return [_described(number, device) for number, device in enumerate(_all())]


def chosen(name: str) -> tuple[FoundDevice, Any]:
    """The device of a name, `opencl` (the first GPU, else the first of all) or `opencl:1`. Raises ModelError."""
    every, (_, _, number) = _all(), name.partition(":")
    descriptions = [_described(at, device) for at, device in enumerate(every)]
    if number and int(number) >= len(every):
        raise ModelError(
            f"device {name} does not exist; use one of opencl:0 to opencl:{len(every) - 1} (--device list)"
        )
    best = (
        int(number) if number else next((candidate.number for candidate in descriptions if candidate.kind == "GPU"), 0)
    )
    if not descriptions[best].double:
        raise ModelError(f"device opencl:{best}, {descriptions[best].name}, has no float64 ({DOUBLE}); use one with it")
    return descriptions[best], every[best]


class Session:
    """A device with a queue of work; its arrays are `Buffer`s of OpenCL."""

    def __init__(self, name: str) -> None:
        cl = _library()
        self.about, device = chosen(name)
        with self._said():
            self._context = cl.Context([device])
            self._queue = cl.CommandQueue(self._context)
        self._taken = 0

    def room_for(self, *arrays: int) -> None:
        """Raise ModelError if the device has less memory than these arrays take, bytes each, or takes none so large."""
        if max(arrays) > self.about.largest:
            raise ModelError(
                f"device {self.about.name} takes arrays of {self.about.largest / 1e9:.3g} GB at most, and"
                f" {max(arrays) / 1e9:.3g} GB are needed; use fewer nodes, --precision float32, or --device cpu"
            )
        most, wanted = int(SPARE * self.about.memory), self._taken + sum(arrays)
        if wanted > most:
            raise ModelError(
                f"device {self.about.name} has {most / 1e9:.3g} GB, and {wanted / 1e9:.3g} GB are needed; use fewer"
                " nodes, --precision float32, or --device cpu"
            )
        self._taken = wanted

    def expect_countable(self, numbers: int) -> None:
        """Raise ModelError for an array of more numbers than kernels count."""
        if numbers > MOST:
            raise ModelError(
                f"device: nodes have {numbers} components, and a device takes at most {MOST}; use fewer nodes, or"
                " --device cpu"
            )

    def build(self, source: str) -> Any:
        """The program of an OpenCL C source. Raises ModelError for one that the device's compiler refuses."""
        cl = _library()
        if self.about.platform.strip() == POCL and shutil.which(LINKER) is None:
            raise ModelError(
                f"device {self.about.name} of PoCL lacks the linker {LINKER}, with which it builds kernels; install"
                f" {LINKER} on the PATH (on Debian and Ubuntu: apt-get install binutils)"
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a compiler's remarks
            try:
                return cl.Program(self._context, source).build([EXACT], cache_dir=False)
            except cl.RuntimeError as error:
                words = next((line for line in str(error).splitlines() if "error" in line), str(error).splitlines()[0])
                if UNKNOWN in words:
                    raise ModelError(
                        f"device {self.about.name} is a processor that this {self.about.platform.strip()} does not"
                        f" know ({words.strip()}); use one that it builds kernels for (--device cpu needs none)"
                    ) from None
                raise ModelError(
                    f"device {self.about.name}: its compiler refuses the kernel; use one that builds it:"
                    f" {words.strip()}"
                ) from None

    def put(self, values: NDArray[Any]) -> Any:
        """A buffer with a copy of these values; of none, of a few bytes."""
        cl = _library()
        values = np.ascontiguousarray(values)
        if not values.size:
            values = np.zeros(8, dtype=values.dtype)
        with self._said():
            flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
            return cl.Buffer(self._context, flags, hostbuf=values)

    def upload(self, arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
        """Buffers with copies of these arrays, by name. Raises ModelError if the device has too little memory."""
        self.room_for(*(array.nbytes for array in arrays.values()))
        return {name: self.put(array) for name, array in arrays.items()}

    def clear(self, buffer: Any) -> None:
        """Set all bytes of a buffer to 0."""
        with self._said():
            _library().enqueue_fill_buffer(self._queue, buffer, np.uint8(0), 0, buffer.size)

    def write(self, buffer: Any, values: NDArray[Any], at: int = 0) -> None:
        """Copy values into a buffer, from the byte `at` on."""
        if values.size:
            with self._said():
                _library().enqueue_copy(self._queue, buffer, np.ascontiguousarray(values), dst_offset=at)

    def read(self, buffer: Any, values: NDArray[Any], at: int = 0) -> None:
        """Copy a buffer, from the byte `at` on, into contiguous values."""
        if values.size:
            with self._said():
                _library().enqueue_copy(self._queue, values, buffer, src_offset=at)

    def launch(self, kernel: Any, size: tuple[int, int], arguments: Sequence[Any]) -> None:
        """Queue a kernel over so many work items at least, in groups of so many."""
        items, group = size
        with self._said():
            kernel(self._queue, (-(-items // group) * group,), (group,), *arguments)

    def finish(self) -> None:
        """Wait until all that is queued is done."""
        with self._said():
            self._queue.finish()

    @contextmanager
    def _said(self) -> Iterator[None]:
        """A context that turns an error of the device into one of this package."""
        cl = _library()
        try:
            yield
        except cl.MemoryError as error:
            raise ModelError(
                f"device {self.about.name} has no memory for the run ({error}); use fewer nodes, or --device cpu"
            ) from None
        except cl.Error as error:
            if "INVALID_BUFFER_SIZE" in str(error):
                raise ModelError(
                    f"device {self.about.name} takes no array of this size; use fewer nodes, --precision float32,"
                    " or --device cpu"
                ) from None
            raise DeviceLostError(f"device {self.about.name} is lost ({error}); go on with --resume") from None


def _all() -> list[Any]:
    cl, device_list = _library(), []
    with suppress(cl.Error):  # without a runtime
        for platform in cl.get_platforms():
            with suppress(cl.Error):  # one whose device is gone hides no other
                device_list += platform.get_devices()
    if not device_list:
        raise ModelError(
            "device: no OpenCL runtime has a device; install a driver of the device, or PoCL: pip install"
            " pocl-binary-distribution"
        )
    return device_list


@cache
def _library() -> Any:
    """The module pyopencl; PoCL keeps compiled code in the user's own folder, pyopencl keeps none."""
    place, _ = trust.private_folder()
    # A model alone can choose a device, in a process that no command has prepared
    trust.settle_variables("OpenCL loader", "PoCL", "pyopencl", "drivers of GPUs")
    os.environ.setdefault("POCL_CACHE_DIR", str(place / "pocl"))
    os.environ.setdefault("PYOPENCL_NO_CACHE", "1")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import pyopencl
    except ImportError:
        raise ModelError(
            f"device: the package pyopencl is missing; install it ({INSTALL}), or use --device cpu"
        ) from None
    return pyopencl


def _described(number: int, device: Any) -> FoundDevice:
    types = _library().device_type
    kind = "GPU" if device.type & types.GPU else "CPU" if device.type & types.CPU else "other"
    return FoundDevice(
        number,
        device.platform.name,
        device.name,
        kind,
        DOUBLE in device.extensions.split(),
        int(device.global_mem_size),
        int(device.max_mem_alloc_size),
        int(device.max_compute_units),
    )
