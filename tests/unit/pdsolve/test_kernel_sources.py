"""What a kernel is compiled from is what its digest is made of, and nothing else is."""

from __future__ import annotations

import inspect
import types
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from pdsolve.codegen import kernel_sources

KERNELS = sorted(kernel_sources.name_of(Path(file)) for file in kernel_sources.with_kernels())


def called(function: Any, seen: set[Any]) -> Iterator[str]:
    """The modules of all functions that a function calls, at any remove."""
    function = getattr(function, "py_func", function)
    if not isinstance(function, types.FunctionType) or function in seen:
        return
    seen.add(function)
    yield function.__module__
    codes = [function.__code__]
    while codes:
        code = codes.pop()
        codes += [one for one in code.co_consts if isinstance(one, types.CodeType)]
        for name in code.co_names:
            found = function.__globals__.get(name)
            if inspect.ismodule(found):
                yield found.__name__
                for attribute in code.co_names:
                    yield from called(vars(found).get(attribute), seen)
            else:
                yield from called(found, seen)


def test_kernels_are_found() -> None:
    assert "pdsolve.operators.bond_list_loops" in KERNELS
    assert len(KERNELS) > 10


@pytest.mark.parametrize("name", KERNELS)
def test_all_that_a_kernel_calls_is_in_its_digest(name: str) -> None:
    counted = kernel_sources._closure([name, *kernel_sources._laws()])
    functions = [one for one in vars(import_module(name)).values() if getattr(one, "__module__", "") == name]
    found = {module for one in functions for module in called(one, set())}
    assert name in found
    ours = {one for one in found if one in kernel_sources._sources()}
    assert ours <= counted


def test_laws_count_for_every_kernel_and_results_for_none() -> None:
    for name in KERNELS:
        counted = kernel_sources._closure([name, *kernel_sources._laws()])
        assert {"pdsolve.laws.pair_laws.brittle", "pdsolve.laws.materials.j2"} <= counted
        assert not any(one.startswith(("pdsolve.results", "pdsolve.study")) for one in counted)


def test_a_change_changes_the_digest_of_what_is_made_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    sources = dict(kernel_sources._sources())
    file, other = inspect.getfile(import_module("pdsolve.operators.bond_list_loops")), "pdsolve.results.writer"
    before = digest(file)
    monkeypatch.setattr(kernel_sources, "_sources", lambda: sources)
    sources[other] += "\n# changed\n"
    assert digest(file) == before
    sources["pdsolve.laws.pair_laws.brittle"] += "\n# changed\n"
    assert digest(file) != before


def test_a_file_of_ones_own_counts_itself(tmp_path: Path) -> None:
    path = tmp_path / "law.py"
    path.write_text("LIMIT = 1\n")
    before = digest(str(path))
    path.write_text("LIMIT = 2\n")
    assert digest(str(path)) != before


def digest(file: str) -> str:
    return kernel_sources.digest_of.__wrapped__(file)


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("laws/__init__.py", "pdsolve.laws"),
        ("laws/pair_laws/brittle.py", "pdsolve.laws.pair_laws.brittle"),
        ("__init__.py", "pdsolve"),
    ],
)
def test_the_file_of_a_package_has_its_name(file: str, name: str) -> None:
    assert kernel_sources.name_of(Path(kernel_sources.__file__).parent.parent / file) == name
