"""OpenCL for tests, PoCL with a cache of its own; where package or runtime is missing, tests are skipped by name."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from functools import cache

import pytest

from pdsolve.model import ModelError
from pdsolve.operators.device.runtime import devices

os.environ["POCL_CACHE_DIR"] = fresh = tempfile.mkdtemp(prefix="pocl-")
atexit.register(shutil.rmtree, fresh, ignore_errors=True)


@cache
def missing() -> str:
    """What is missing for OpenCL, "" if nothing is."""
    try:
        return "" if devices() else "no device"
    except ModelError as error:
        return str(error)


needs_opencl = pytest.mark.skipif(bool(missing()), reason=missing() or "nothing")
