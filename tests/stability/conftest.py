"""Where methods fail: every test here pins a failure and its cure, and all of them together are a page.

A test that takes the fixture `failure` is a case of the page: the first line of its docstring is the heading, the rest
says why, and what it tells the fixture are the numbers. `pytest tests/stability --failures-page FILE` writes the page.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from failure_cases import Said, cases, page, reason_of, theme_of

from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdsolve.__main__ import main
from pdsolve.model import Model

_told = pytest.StashKey[dict[tuple[str, str], str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Where to write the page."""
    parser.addoption("--failures-page", type=Path, help="write what tests/stability found as a page")


@pytest.fixture
def failure(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Takes down what a test has found: what fails, how the program notices and what it says, and the cure."""
    key = theme_of(request.module.__doc__), theme_of(request.function.__doc__)

    def tell(*, fails: str, noticed: str, says: Sequence[str] = (), cure: str) -> None:
        quotes = "".join(f"\n\n> {' '.join(line.split())}" for line in says)
        parts = [
            f"### {key[1]}",
            reason_of(request.function.__doc__),
            f"**Fails.** {fails}",
            f"**Noticed.** {noticed}{quotes}",
        ]
        text = "\n\n".join(part for part in [*parts, f"**Cure.** {cure}"] if part)
        request.config.stash.setdefault(_told, {})[key] = text

    return tell


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Write the page if one was asked for and every case has spoken."""
    path: Path | None = session.config.getoption("--failures-page", None)
    if path is None:
        return
    told = session.config.stash.get(_told, {})
    missing = [heading for theme, heading in cases() if (theme, heading) not in told]
    if missing:
        raise pytest.UsageError(f"{path}: not written; did not run to the end: {', '.join(missing)}")
    path.write_text(page(told), encoding="utf-8")


@pytest.fixture
def pdsolve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    """Runs the program on a model, or on the text of a grid file; returns what it says."""
    monkeypatch.chdir(tmp_path)

    def run(model: Model | str, *arguments: str) -> Said:
        path = Path("plate.json")
        if isinstance(model, str):
            path.write_text(model)
        else:
            write_file(document_of(model.grid, model.settings), path)
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            code = main([str(path), "--force", "--threads", "1", *arguments])
        out, err = capsys.readouterr()
        told = [line for line in err.splitlines() if line.startswith("pdsolve: ")]  # without progress
        return Said(code, out.splitlines(), told)

    return run
