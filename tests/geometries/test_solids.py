"""The shipped scenes of state-based models, coarsely, each with a number that is known or pinned."""

from __future__ import annotations

import numpy as np
import pytest
from plates import shipped

from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate


def solved(name: str, **parameters: str) -> Results:
    """All of it, with other parameters."""
    made = shipped(name, list(parameters.items()))
    return simulate(Model(made.grid, made.settings), None, Options(threads=1))


@pytest.mark.slow
def test_the_end_of_a_bar_moves_as_waves_have_it() -> None:
    """1, 2, 1, 0 times sigma L / E at 1, 2, 3, 4 times L / c; of 40 spacings."""
    with solved("bar.py", spacing="0.025") as results:
        steps, times = results.frames()
        position = results.nodes().position
        end = position[:, 0] > 0.999
        found = [float(results.field("ux", int(step))[end].mean() / 1e-3) for step in steps[np.isclose(times % 1, 0)]]
    assert found == pytest.approx([0, 1, 2, 1, 0], abs=0.1)


@pytest.mark.slow
def test_a_block_of_rubber_pulls_back() -> None:
    """Finite elements have 0.42257; cells at the edges are halves, and the clamps single columns."""
    with solved("rubber_block.py") as results:
        table, last = results.reactions(), int(results.frames()[0][-1])
        force = table["force_x"][(table["condition"] == 1) & (table["step"] == last)]
        position, uy = results.nodes().position, results.field("uy", last)
        narrowed = uy[np.abs(position - [0.5, 0]).max(axis=1) < 1e-9]
    assert force == pytest.approx([0.4115], abs=1e-3)
    assert narrowed == pytest.approx([0.0834], abs=5e-4)  # finite elements: 0.08558


@pytest.mark.slow
def test_a_beam_of_steel_flows() -> None:
    """Fibres have 1, 1.393, 1.4733, 1.5022 of the moment at which the first one flows, 46.8787e4 N."""
    with solved("plastic_beam.py") as results:
        x, y = results.nodes().position.T
        middle = np.abs(x) < 1e-6
        stress = [results.field("sxx", step)[middle] for step in (4, 8, 12, 16)]
        assert results.field("plastic", 16).max() == pytest.approx(3.86e-3, rel=0.02)
    share = np.where(np.abs(y[middle]) > 0.0499, 0.5, 1.0) * y[middle] * 0.01  # cells at the edges are halves
    found = [float((one * share).sum() / 46.8787e4) for one in stress]
    assert found == pytest.approx([0.978, 1.4066, 1.4852, 1.5169], abs=0.002)  # ten spacings high: 1.0 % off


@pytest.mark.slow
def test_a_notched_beam_softens() -> None:
    """Reports have its peak at 750 to 850 N, an independent program of bonds at 798 N; then it falls to nothing."""
    with solved("notched_beam.py") as results:
        table = results.reactions()
        force = 0.05 * np.abs(table["force_y"][table["condition"] == 2])
    assert force.max() == pytest.approx(803, rel=0.01)
    assert force[-1] < 0.05 * force.max()  # measured 0.03


@pytest.mark.slow
def test_a_square_bends_and_turns_as_it_is_said_to() -> None:
    """Its middle by 30 degrees less half of a radian."""
    with solved("bent_square.py") as results:
        last = int(results.frames()[0][-1])
        X, Y = results.nodes().position.T
        u = np.column_stack([results.field(name, last) for name in ("ux", "uy")])
        middle = np.abs(results.nodes().position - 0.5).max(axis=1) < 1e-9
        (turned,) = np.degrees(results.field("rotation", last)[middle])
    c, s, r = np.cos(np.pi / 6), np.sin(np.pi / 6), 0.5 + Y
    x, y = r * np.sin(X), r * np.cos(X) - 0.5
    off = u - np.column_stack([c * x - s * y - X, s * x + c * y - Y])
    assert turned == pytest.approx(30 - np.degrees(0.5), abs=1e-3)  # measured 1.35211 of 1.35211
    assert np.sqrt((off**2).sum(axis=1).mean()) == pytest.approx(2.16e-5, rel=0.02)
