"""The public names: there when asked for, each what its home has, and no name of a module."""

from __future__ import annotations

import pkgutil
import re
from pathlib import Path
from types import ModuleType

import pytest

import pdmesh
import pdpost
import pdsolve

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "api" / "index.md").read_text(encoding="utf-8")
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


@pytest.mark.parametrize("name", ["pdmesh", "pdsolve", "pdpost"])
def test_the_page_has_every_public_name(name: str) -> None:
    told = re.findall(r"^\.\. auto\w+:: \w+\.(\w+)$", PAGE, re.MULTILINE)
    assert {public for public in PACKAGES[name].__all__ if public != "box"} <= set(told)


@pytest.mark.slow
def test_the_blocks_of_the_page_run_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(block, "page", "exec"), names)
    assert {path.name for path in tmp_path.iterdir()} >= {"plate.json", "plate.sqlite", "damage.png", "study.toml"}
