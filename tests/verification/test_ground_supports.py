"""Spring supports and pins in holes, against statics, one mass on a spring, and a beam on an elastic bed."""

from __future__ import annotations

from functools import cache

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid
from shapely import Point

from pdmesh import Scene, box, build
from pdmesh.grid.building import Built
from pdmesh.model.document import AnyCondition, InitialVelocity, Load, Pin, Run, Spring
from pdsolve.model import Model, ModelError
from pdsolve.operators.ground_supports import GroundSupports
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, simulate
from pdsolve.state import State, Unknown

H = 1e-3
REST = Run(solver="static")
BED, LENGTH = 2e9, 21 * H  # N/m^3, m
BOTTOM = (-1.0, 0.0, 1.0, 0.0)


def solved(built: Built) -> Results:
    return simulate(Model(built.grid, built.settings), options=Options(threads=1))


def block(*conditions: AnyCondition, run: Run = REST) -> Model:
    """A block of 21 x 11 nodes on a bed along its lowest row."""
    bed = Spring(box=BOTTOM, stiffness=(BED / 4, BED), length=LENGTH)
    return plate(square_grid(21, 11), conditions=(bed, *conditions), run=run)


def test_a_block_at_rest_sinks_by_its_load_over_the_bed() -> None:
    push = Load(box=(-1.0, 10 * H, 1.0, 10 * H), force=(50.0, -1e3))
    with simulate(block(push), options=Options(threads=1)) as results:
        rows = results.reactions()
    bed = rows[rows["condition"] == 0][-1]
    assert bed["displacement_y"] == pytest.approx(-1e3 / (BED * LENGTH), rel=1e-9)  # measured 1e-15
    assert bed["displacement_x"] == pytest.approx(50.0 / (BED / 4 * LENGTH), rel=1e-9)
    assert bed["force_y"] == pytest.approx(1e3, rel=1e-9)
    assert bed["force_x"] == pytest.approx(-50.0, rel=1e-9)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("kernel", ["listed", "blocks"])
def test_a_stiff_block_bobs_as_a_mass_on_a_spring(kernel: str) -> None:
    """A quarter of a period after it set off, all its energy is in the bed and it is at its lowest."""
    stiffness, speed, mass = BED * LENGTH, 0.1, GLASS.rho * 21 * 11 * H * H
    omega = float(np.sqrt(stiffness / mass))
    soft = Spring(box=BOTTOM, stiffness=(0.0, BED), length=LENGTH)
    quarter = np.pi / 2 / omega
    run = Run(time_step=quarter / 2000, steps=2000, every=2000)
    go = InitialVelocity(box=(-1.0, -1.0, 1.0, 1.0), y=-speed)
    model = plate(square_grid(21, 11), conditions=(soft, go), run=run)
    with simulate(model, options=Options(threads=1, kernel=kernel)) as results:
        ledger, v = results.history()[-1], results.field("vy", 2000)
        u = results.field("uy", 2000)
    assert u.mean() == pytest.approx(-speed / omega, rel=2e-4)  # measured +4.3e-5: the block gives a little
    assert abs(v.mean()) < 3e-4 * speed  # measured 6.8e-5
    assert ledger["strain"] == pytest.approx(mass * speed**2 / 2, rel=1e-6)  # measured 1.5e-7


@pytest.mark.slow
def test_a_beam_on_an_elastic_bed_sags_as_hetenyi_has_it() -> None:
    """M. Hetenyi, Beams on elastic foundation (1946): w = P b / (2 k) under the load of a long beam, b^4 = k / 4 E I.

    The bed acts along the lower side of a beam 8 spacings high.
    """
    high, k, force = 16 * H, 4e9, 1e4
    inertia = high**3 / 12
    b = (k / (4 * GLASS.E * inertia)) ** 0.25
    length = 0.44
    assert b * length > 6  # long
    scene = (
        Scene(box(-length / 2, 0, length / 2, high), 2 * H, GLASS, run=REST)
        .spring("bottom", stiffness=(1e6, k), name="bed")
        .load(Point(0, high), force=(0, -force), name="push")
    )
    with solved(build(scene)) as results:
        last = int(results.frames()[0][-1])
        grid, u = results.nodes(), results.field("uy", last)
    row = np.flatnonzero(np.abs(grid.position[:, 1]) < 1e-9)
    x, w = grid.position[row, 0], -u[row]
    exact = force * b / (2 * k) * np.exp(-b * np.abs(x)) * (np.cos(b * x) + np.sin(b * np.abs(x)))
    assert w[np.abs(x).argmin()] == pytest.approx(force * b / (2 * k), rel=0.02)  # measured 1.011
    near = np.abs(x) < length / 4  # the beam is not endless
    assert np.abs(w - exact)[near].max() < 0.02 * exact.max()  # measured 0.012: shear, and the lattice


@cache
def lever() -> Built:
    """A bar that turns on a pin, held up by a bed at its far end and pushed down in the middle."""
    scene = (
        Scene(box(0, 0, 0.1, 0.02), H, GLASS, run=REST)
        .hole(Point(0.01, 0.01).buffer(0.005))
        .pin_hole("hole nearest 0.01,0.01", name="pin")
        .spring("right", stiffness=(0, 1e11), name="bed")
        .load("along (0.045,0.02) (0.055,0.02)", force=(0, -1e3), name="push")
    )
    return build(scene)


@pytest.mark.slow
def test_a_pin_takes_no_moment_about_its_centre() -> None:
    with solved(lever()) as results:
        rows = results.reactions()
    force = {name: rows[rows["condition"] == k][-1]["force_y"] for k, name in enumerate(("pin", "bed", "push"))}
    assert force["bed"] == pytest.approx(1e3 * 40 / 90, rel=1e-5)  # of the arms; measured 1.1e-6, as arms turn
    assert force["pin"] == pytest.approx(1e3 * 50 / 90, rel=1e-5)


def test_a_pinned_plate_turns_as_a_rigid_body_without_any_force() -> None:
    model = Model(lever().grid, lever().settings)
    operator = GroundSupports(model, model.grid.cells, (Unknown("u", 2, 2),))
    (pin,) = (condition for condition in model.settings.conditions if isinstance(condition, Pin))
    arm = model.grid.position - np.array(pin.centre)
    turn = 1e-3 * np.column_stack([-arm[:, 1], arm[:, 0]])
    rows, out = model.selected(pin), np.zeros_like(turn)
    operator.accumulate_force(moved(turn), out, 0, 0.0)
    assert np.abs(out[rows]).max() < 1e-12 * 4 * GLASS.E / H**2 * np.abs(turn[rows]).max()
    out[:] = 0.0
    operator.accumulate_force(moved(np.full_like(turn, 1e-6)), out, 0, 0.0)
    assert (out[rows] < 0).all()  # a shift is held


def moved(u: NDArray[np.float64]) -> State:
    return State(u, *np.zeros((2, *u.shape)), *np.zeros((3, len(u))))


def test_forces_are_the_slope_of_the_energy_and_give_the_tangent() -> None:
    model = Model(lever().grid, lever().settings)
    volume = model.grid.cells
    operator = GroundSupports(model, volume, (Unknown("u", 2, 2),))
    u, way = np.random.default_rng(1).normal(size=(2, len(volume), 2)) * 1e-6

    def energy(share: float) -> float:
        return float(volume @ operator.energies(moved(u + share * way))[0])

    out, pull = np.zeros_like(u), np.zeros_like(u)
    operator.accumulate_force(moved(u), out, 0, 0.0)
    slope = (energy(0.5) - energy(-0.5)) / 1.0  # of a parabola: exact
    assert slope == pytest.approx(-float((volume[:, None] * out * way).sum()), rel=1e-9)
    operator.accumulate_force(moved(way), pull, 0, 0.0)
    tangent = operator.tangent(moved(u))
    assert -(tangent @ way.ravel()) == pytest.approx(pull.ravel(), rel=1e-9, abs=1e-9 * np.abs(pull).max())
    assert np.linalg.eigvalsh(tangent.toarray()[-42:, -42:]).max() <= 2 * operator.stiffness_bound().max() * (1 + 1e-12)


def test_what_a_pin_or_a_bed_along_one_axis_leaves_free_is_said() -> None:
    settings = lever().settings
    alone = msgspec.structs.replace(settings, conditions=(settings.conditions[0], settings.conditions[2]))
    with pytest.raises(ModelError, match=r"\$\.conditions.*the whole plate .* can turn"):
        prepare(Model(lever().grid, alone), Options(threads=1))


@pytest.mark.parametrize(
    ("bed", "run", "said"),
    [
        (Spring(box=BOTTOM, stiffness=(0.0, 1e9)), Run(device="opencl"), r"\$\.conditions\[0\].*spring"),
        (Spring(box=BOTTOM), Run(), r"\$\.conditions\[0\].*none given"),
        (Spring(box=BOTTOM, stiffness=(0.0, 0.0)), Run(), r"\$\.conditions\[0\]\.stiffness.*0"),
        (Spring(box=BOTTOM, stiffness=(1.0, 1.0, 1.0)), Run(), r"\$\.conditions\[0\]\.stiffness.*3 numbers"),
        (Spring(box=BOTTOM, stiffness=(1.0, 1.0), surface=1.0), Run(), r"\$\.conditions\[0\]\.surface cannot"),
    ],
)
def test_what_cannot_be_is_refused(bed: Spring, run: Run, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        prepare(plate(square_grid(21, 11), conditions=(bed,), run=run), Options(threads=1))
