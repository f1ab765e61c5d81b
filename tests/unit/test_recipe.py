"""The conda recipe asks for what the package asks for."""

from __future__ import annotations

import re
import tomllib

import pytest
from plates import ROOT

from pdmesh import VERSION

OTHERWISE = {"python-gmsh": "gmsh", "matplotlib-base": "matplotlib"}


def test_the_recipe_has_the_dependencies_of_the_package_and_its_programs() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    asked = re.findall(r"^    - (\S+) (\S+)$", recipe.split("  run:\n")[1].split("\ntests:")[0], re.MULTILINE)
    found = {OTHERWISE.get(name, name): pin for name, pin in asked}
    assert found.pop("python") == project["requires-python"]
    assert [name + pin for name, pin in sorted(found.items())] == sorted(project["dependencies"])
    programs = re.findall(r"^      - (\w+) = (\S+)$", recipe, re.MULTILINE)
    assert dict(programs) == project["scripts"]
    assert f'version: "{VERSION}"' in recipe


def test_the_recipe_is_one_of_rattler_build() -> None:
    rattler_build = pytest.importorskip("rattler_build")
    (variant,) = rattler_build.Stage0Recipe.from_file(ROOT / "conda" / "recipe.yaml").render()
    assert (variant.recipe.package.name, str(variant.recipe.package.version)) == ("pdsuite", VERSION)
