"""Names of a package that are imported on first use."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module


def lazily(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """The `__getattr__` and the `__dir__` of a package; each name comes from its module in `homes`.

    A name with the home "package.name" is that module itself.
    """

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module '{package}' has no attribute '{name}'", name=name, obj=sys.modules[package])
        home = import_module(homes[name])
        attribute = home if homes[name] == f"{package}.{name}" else getattr(home, name)
        setattr(sys.modules[package], name, attribute)  # from now on as if it had been imported there
        return attribute

    return get, lambda: sorted({*vars(sys.modules[package]), *homes})
