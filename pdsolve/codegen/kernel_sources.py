"""The sources of a compiled kernel, so that changes elsewhere do not cause recompilation.

A kernel depends on its own file, on all files that it imports directly or indirectly, and on the laws, whose functions
are bound by argument types without being imported.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from pdmesh import trust

FOLDERS = ("pdsolve", "pdmesh/model")  # what kernels are made of is in here
LAWS = "pdsolve.laws."
PUBLIC = "pdsolve"  # the package's own file imports nothing before it is asked
IMPORT = re.compile(r"^\s*from ((?:pdsolve|pdmesh)[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
KERNEL = re.compile(r"^from \S+ import .*\bcached_njit\b", re.MULTILINE)
OVERLOAD = re.compile(r"^\s*@overload(?:ed)?\(", re.MULTILINE)


@cache
def digest_of(file: str) -> str:
    """Digest (64 hex digits) of all sources of a file's kernels.

    A file outside the packages may import any of them: all of them count, and its own text.
    """
    sources, path = _sources(), Path(file).resolve()
    name = name_of(path)
    names = _closure([name, *_laws()]) if name in sources else frozenset(sources)
    digest = hashlib.sha256() if name in sources else hashlib.sha256(path.read_bytes())
    for source_name in sorted(names):
        digest.update(f"{source_name} {_digest(sources[source_name])}\n".encode())
    return digest.hexdigest()


def name_of(path: Path) -> str:
    """The dotted name of a file of the packages; of any other, its name alone."""
    if not path.is_relative_to(trust.HOME):
        return path.stem
    parts = path.relative_to(trust.HOME).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def with_kernels() -> Iterator[str]:
    """Files of the packages that contain kernels."""
    for name, text in _sources().items():
        if KERNEL.search(text):
            yield str(trust.HOME.joinpath(*name.split(".")).with_suffix(".py"))


@cache
def _digest(text: str) -> str:
    """Digest of a source, cached as many kernels share it."""
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _sources() -> dict[str, str]:
    """Texts of all files that kernels may depend on, by dotted name."""
    paths = (path for folder in FOLDERS for path in sorted((trust.HOME / folder).rglob("*.py")))
    return {name_of(path): path.read_text(encoding="utf-8") for path in paths}


@cache
def _laws() -> tuple[str, ...]:
    return tuple(name for name, text in _sources().items() if name.startswith(LAWS) or OVERLOAD.search(text))


@cache
def _imports(name: str) -> frozenset[str]:
    """Files that a file imports from."""
    modules = set()
    for module, words in IMPORT.findall(_sources()[name]):
        modules |= {module, *(f"{module}.{word}" for word in re.findall(r"\w+", words))}
    return frozenset(modules & _sources().keys() - {PUBLIC})


def _closure(names: Iterable[str]) -> frozenset[str]:
    """These files and all that they import, directly or indirectly."""
    files: set[str] = set()
    pending = set(names)
    while pending:
        files |= pending
        pending = {imported for name in pending for imported in _imports(name)} - files
    return frozenset(files)
