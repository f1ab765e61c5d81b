"""Which systems and Pythons have wheels of every requirement: python .ci/wheels.py [REQUIREMENT ...] prints a table.

uv resolves each requirement and all that it needs from the package index, as pip would on the other system: wheels
alone, and no versions before a release. Nothing is downloaded but what the index says. The exit status is 1 where a
requirement of the package itself, not of an extra, lacks a wheel on a system of `SUPPORTED`.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SUPPORTED = {  # headings of the table, and uv's names
    "Linux x86-64": "x86_64-manylinux_2_28",
    "macOS ARM": "aarch64-apple-darwin",
    "Windows x86-64": "x86_64-pc-windows-msvc",
}
OTHERS = {"Linux ARM": "aarch64-manylinux_2_28", "macOS x86-64": "x86_64-apple-darwin"}
AT_ONCE = 4


def requirements() -> dict[str, str]:
    """Each requirement, and the extra it is of, "" for those of the package itself."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    return dict.fromkeys(project["dependencies"], "") | {
        requirement: extra for extra, requirements in extras.items() for requirement in requirements
    }


def with_wheels(names: list[str], platform: str, python: str) -> set[str]:
    """The requirements that have wheels there: all at once if they can be installed together, else by halves."""
    if has_wheels("\n".join(names), platform, python):
        return set(names)
    if len(names) == 1:
        return set()
    half = len(names) // 2
    return with_wheels(names[:half], platform, python) | with_wheels(names[half:], platform, python)


def has_wheels(requirements: str, platform: str, python: str) -> bool:
    """Whether requirements, a line each, and all that they need, have wheels that can be installed together.

    Raises OSError if the index cannot be asked.
    """
    command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--only-binary", ":all:", "-"]
    command += ["--prerelease", "disallow", "--python-platform", platform, "--python-version", python]
    ended = subprocess.run(command, input=requirements, capture_output=True, text=True, cwd="/")
    if ended.returncode and "No solution found" not in ended.stderr:
        raise OSError(ended.stderr.strip())
    return ended.returncode == 0


def cell(pythons: list[str]) -> str:
    """The Pythons of a cell: "all", "none", or which."""
    return "all" if pythons == list(PYTHONS) else ", ".join(pythons) or "none"


def main(names: list[str]) -> int:
    """Print the table of the requirements whose names begin with one of `names`, of all without any."""
    chosen = {name: extra for name, extra in requirements().items() if not names or name.startswith(tuple(names))}
    platforms = SUPPORTED | OTHERS
    cases = list(product(platforms.values(), PYTHONS))
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = dict(zip(cases, pool.map(lambda case: with_wheels(list(chosen), *case), cases), strict=True))
    print(f"Python {PYTHONS[0]} to {PYTHONS[-1]}\n\n| requirement | extra | {' | '.join(platforms)} |")
    print("|---" * (2 + len(platforms)) + "|")
    missing = 0
    for name, extra in chosen.items():
        cells = {
            heading: cell([python for python in PYTHONS if name in found[platform, python]])
            for heading, platform in platforms.items()
        }
        missing += sum(cells[heading] != "all" for heading in SUPPORTED if not extra)
        print(f"| {name} | {extra} | {' | '.join(cells.values())} |")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
