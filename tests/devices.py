"""OpenCL for tests, PoCL with a cache of its own; where package or runtime is missing, tests are skipped by name."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import pytest
from database_contents import contents

from pdmesh import Body, Box
from pdmesh.drawing.building import meshed
from pdmesh.grid.building import build
from pdmesh.model.document import Material, Region
from pdsolve.device import runtime
from pdsolve.device.runtime import devices
from pdsolve.model import Model, ModelError

os.environ["POCL_CACHE_DIR"] = fresh = tempfile.mkdtemp(prefix="pocl-")
atexit.register(shutil.rmtree, fresh, ignore_errors=True)


LEAST = "kernel void one(global float *a) { a[get_global_id(0)] = 1; }"


@cache
def missing() -> str:
    """What is missing for OpenCL, "" if nothing is: a runtime may not know the processor that it runs on."""
    try:
        if not devices():
            return "no device"
        runtime.Session("opencl").build(LEAST)
    except ModelError as error:
        return str(error)
    return ""


needs_opencl = pytest.mark.skipif(bool(missing()), reason=missing() or "nothing")


class Failing:
    """What stands for pyopencl and fails."""

    def __init__(self, instead: dict[str, Any]) -> None:
        self._library, self._instead = runtime._library(), instead

    def __getattr__(self, name: str) -> Any:
        return self._instead.get(name) or getattr(self._library, name)


def without_runtime() -> Callable[[], Failing]:
    """What stands for `runtime._library` on a machine with pyopencl and without a runtime."""
    library = runtime._library()

    def none() -> list[Any]:
        raise library.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    failing = Failing({"get_platforms": none})
    return lambda: failing


def bar(law: dict[str, Any] | None = None, fine: float | None = None, **settings: Any) -> Model:
    """A bar of two materials, bent and pulled until it breaks; with nodes of the spacing `fine` in its middle."""
    brittle = Material(E=1e6, rho=1000.0, G0=3.0, micromodulus="constant", plane="space", **(law or {}))
    body = Body(Box((0, 0, 0), (0.7, 0.5, 0.4)), 0.05, brittle).fix("left").load("right", (4e4, 0, 1e3))
    if fine is not None:
        body = body.zone(Box((0.3, 0.2, 0.1), (0.5, 0.4, 0.3)), fine)
    found = build(meshed(body))
    stiffer = Region(material=msgspec.structs.replace(brittle, E=2e6), box=(0.0, 0.0, 0.0, 0.35, 1.0, 1.0))
    return Model(found.grid, msgspec.structs.replace(found.settings, regions=(stiffer,), **settings))


def alike(found: Path, expected: Path) -> None:
    """Expect files to have the same in all tables but that whose model names its device."""
    rows, others = contents(found), contents(expected)
    assert rows.keys() == others.keys()
    for name in rows.keys() - {"meta"}:
        assert rows[name] == others[name], name
