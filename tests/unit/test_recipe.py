"""The conda recipe asks for what the package asks for."""

from __future__ import annotations

import re
import tomllib

from plates import ROOT

OTHERWISE = {"python-gmsh": "gmsh", "matplotlib-base": "matplotlib"}


def test_the_recipe_has_the_dependencies_of_the_package_and_its_programs() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    asked = re.findall(r"^    - (\S+) (\S+)$", recipe.split("  run:\n")[1].split("\ntest:")[0], re.MULTILINE)
    found = {OTHERWISE.get(name, name): pin for name, pin in asked}
    assert found.pop("python") == project["requires-python"]
    assert [name + pin for name, pin in sorted(found.items())] == sorted(project["dependencies"])
    programs = re.findall(r"^    - (\w+) = (\S+)$", recipe, re.MULTILINE)
    assert dict(programs) == project["scripts"]
    (pattern,) = re.findall(r"regex_pattern='(.+?)'", recipe)
    assert re.search(pattern, (ROOT / "pdmesh" / "__init__.py").read_text(encoding="utf-8"))
