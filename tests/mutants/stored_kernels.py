"""For pytest, where what is wrong is in no kernel: those that are compiled already are used, of whatever copy."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "KERNELS_OF_MUTANTS"  # the folder they are in


def pytest_configure() -> None:
    """Keep kernels in one folder, whatever the sources say and wherever they are."""
    from pdsolve.codegen import jit_cache

    tree, folder = Path(jit_cache.__file__).parent.parent, Path(os.environ[VARIABLE])

    def path(file: str) -> Path:
        return folder / Path(file).relative_to(tree).with_suffix("")

    jit_cache.folder_of = path  # type: ignore[assignment]
