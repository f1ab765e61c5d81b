"""The public names: there when asked for, each what its home has, and no name of a module."""

from __future__ import annotations

import pkgutil
from types import ModuleType

import pytest

import pdmesh
import pdpost
import pdsolve

PACKAGES = {"pdmesh": pdmesh, "pdsolve": pdsolve, "pdpost": pdpost, "pdpost.figures": pdpost.figures}


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_is_there(name: str) -> None:
    package = PACKAGES[name]
    assert package.__all__ == sorted(package.__all__)
    for public in package.__all__:
        assert public in dir(package)
        found = getattr(package, public)
        assert found is getattr(package, public)
        assert isinstance(found, ModuleType) or found.__name__ == public
    modules = {module.name for module in pkgutil.iter_modules(package.__path__)}
    assert not modules & {public for public in package.__all__ if not isinstance(getattr(package, public), ModuleType)}


@pytest.mark.parametrize("name", PACKAGES)
def test_no_other_name_is_there(name: str) -> None:
    with pytest.raises(AttributeError, match=f"^module '{name}' has no attribute 'nothing'$"):
        _ = PACKAGES[name].nothing
    with pytest.raises(ImportError, match="cannot import name 'nothing'"):
        exec(f"from {name} import nothing")
