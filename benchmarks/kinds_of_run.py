"""Small runs of every kind that there is, each in a tenth of a second or so: what endurance is tried with."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.models import grid_of_nodes
from pdmesh.model.document import (
    Collocation,
    Concentration,
    Displacement,
    Fatigue,
    Horizon,
    Load,
    Material,
    ParticleRules,
    Run,
    Settings,
    Solid,
    Static,
)
from pdmesh.model.medium import Medium
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.options import Options

H = 1e-3  # m: between nodes
ALONE = Options(threads=1)
GLASS = Material(E=72e9, rho=2440.0, G0=3.8, nu=0.22, plane="strain")
BOND = Material(E=72e9, rho=2440.0, G0=3.8)


def lattice(*counts: int) -> Grid:
    """So many nodes along each axis, half a cell from the edges; in the plane with a crack from the left."""
    axes = np.meshgrid(*[H * (np.arange(count) + 0.5) for count in counts], indexing="ij")
    position = np.column_stack([axis.ravel(order="F") for axis in axes])
    areas = np.full(len(position), H ** len(counts))
    if len(counts) == 3:
        return grid_of_nodes(position, H, areas=areas)
    wide, high = H * np.array(counts)
    outline, level = np.array([[0, 0], [wide, 0], [wide, high], [0, high]]), round(counts[1] / 2) * H
    return grid_of_nodes(position, H, [(0.0, level, wide / 3, level)], outline=(outline,), areas=areas)


def _torn(counts: tuple[int, ...] = (24, 16), ratio: float = 3.0, pull: float = 4e10, **settings: Any) -> Model:
    """The lowest and the highest row of nodes pulled apart."""
    high = H * counts[1]
    side = (0.0,) * (len(counts) - 2)
    box = partial(_box, len(counts))
    ends = (
        Load(box=box(high - H, high), body_force=(0.0, pull, *side)),
        Load(box=box(0.0, H), body_force=(0.0, -pull, *side)),
    )
    run = {"time_step": 5e-8, "steps": 40, "every": 5, "ledger": 5} | settings.pop("run", {})
    given = {"material": BOND, "conditions": ends, "horizon": Horizon(ratio), "run": Run(**run)} | settings
    return Model(lattice(*counts), Settings(**given))


def _box(dimension: int, low: float, high: float) -> tuple[float, ...]:
    return (-1.0, low, *[-1.0] * (dimension - 2), 1.0, high, *[1.0] * (dimension - 2))


def _of(material: dict[str, Any], mode: Options = ALONE, **more: Any) -> tuple[Model, Options]:
    """A torn plate of glass with this of its material changed."""
    return _torn(material=Material(**{"E": 72e9, "rho": 2440.0, "G0": 3.8} | material), **more), mode


def _at_rest(
    apart: float = 2e-6,
    profile: tuple[tuple[float, float], ...] = ((0.0, 0.0), (8.0, 1.0)),
    counts: tuple[int, int] = (24, 16),
    **run: Any,
) -> tuple[Model, Options]:
    """A plate stretched between its edges in load steps."""
    high = H * counts[1]
    edges = (
        Displacement(box=_box(2, high - H, high), x=0.0, y=apart, profile=profile),
        Displacement(box=_box(2, 0.0, H), x=0.0, y=0.0),
    )
    run = {"time_step": None, "steps": 8, "every": 1, "ledger": 1} | run
    return _torn(counts, conditions=edges, run=run), Options(threads=1)


def _diffusing(medium: Medium, **run: Any) -> tuple[Model, Options]:
    """A plate whose lower rows are a solid that dissolves into the others, or a substance that goes through it."""
    grid = lattice(24, 16)
    lower = _rows(grid, grid.position[:, 1] < 5 * H)
    ends = (
        Concentration(nodes=lower, value=1.0) if medium.C_solid is None else Solid(nodes=lower),
        Concentration(nodes=_rows(grid, grid.position[:, 1] > 12 * H), value=0.0),
    )
    settings = Settings(
        physics="diffusion", medium=medium, horizon=Horizon(3.0), conditions=ends,
        run=Run(**{"steps": 40, "every": 5, "time_step": 1e-8} | run),
    )  # fmt: skip
    return Model(grid, settings), ALONE


def _quenched(cold: float = 260.0, D: float = 0.5, **run: Any) -> tuple[Model, Options]:
    """A held plate of 300 K whose left edge is quenched to `cold`, K: bonds break while heat goes through it."""
    grid = lattice(24, 16)
    edge, ends = _rows(grid, grid.position[:, 0] < H), _rows(grid, np.abs(grid.position[:, 1] - 8 * H) > 7 * H)
    settings = Settings(
        physics="thermoelastic",
        material=Material(E=72e9, rho=2440.0, G0=3.8, alpha=1e-5, T0=300.0),
        medium=Medium(D=D, carries="heat", heat_capacity=2e6, deformation=True),
        horizon=Horizon(3.0),
        conditions=(
            Concentration(nodes=edge, value=cold),
            Displacement(nodes=ends, x=0.0, y=0.0),
        ),
        run=Run(**{"steps": 40, "every": 5, "ledger": 5} | run),
    )
    return Model(grid, settings), ALONE


def _tiring(fatigue: Fatigue, counts: tuple[int, int], **run: Any) -> tuple[Model, Options]:
    """A cracked plate whose edges are moved apart again and again."""
    run = {"solver": "static", "steps": 4, "ledger": None, "fatigue": fatigue} | run
    return _at_rest(1e-6, (), counts, **run)


def _rows(grid: Grid, which: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(grid.ids[which].tolist())


STATE_BASED = {"model": "ordinary", "nu": 0.22, "plane": "strain"}
CORRESPONDENCE = {"model": "correspondence", "nu": 0.22, "plane": "strain", "solid": "svk"}
SALT = Medium(D=1.0, C_solid=1.0, C_sat=0.2)
KINETIC = Medium(D=1.0, C_solid=1.0, C_sat=0.2, dissolution="kinetic", k_diss=0.5)
STRESS = ParticleRules(criterion="stress", strength=2.5e7)

KINDS: dict[str, Callable[[], tuple[Model, Options]]] = {
    "bonds": partial(_of, {}),
    "bonds, thesis": partial(_of, {}, Options("thesis", threads=1)),
    "bonds, float32": partial(_of, {}, Options(precision="float32", threads=1)),
    "bonds, listed": partial(_of, {}, Options(threads=1, kernel="listed")),
    "bonds, two threads": partial(_of, {}, Options(threads=2)),
    "bilinear": partial(_of, {"law": "bilinear", "kr": 3.0}),
    "damped": partial(_of, {}, run={"damping": 1e5}),
    "damped by stiffness": partial(_of, {}, run={"damping_time": 3e-8}),
    "damped by stiffness, listed": partial(_of, {}, Options(threads=1, kernel="listed"), run={"damping_time": 3e-8}),
    "until quiet": partial(_of, {}, run={"until": "quiet", "quiet": 1e-3}),
    "static start": partial(_at_rest, time_step=5e-8, steps=40, every=5, ledger=5, start="static"),
    "ordinary": partial(_of, STATE_BASED),
    "correspondence": partial(_of, CORRESPONDENCE),
    "neo-hooke": partial(_of, CORRESPONDENCE | {"solid": "neo hooke"}),
    "micropolar": partial(_of, {"model": "micropolar", "nu": 0.22}),
    "hybrid": partial(_of, {}, counts=(40, 40), ratio=4.0, run={"adapt": "hybrid"}),
    "collocation": partial(
        _of, {}, counts=(61, 60), ratio=4.0, run={"adapt": "collocation", "collocation": Collocation(damped=True)}
    ),
    "split": partial(_of, {}, run={"adapt": "split"}),
    "particles": partial(_of, {}, run={"cracks": "particles", "particles": STRESS}),
    "at rest": partial(_at_rest, solver="static", static=Static(load_steps=8)),
    "heat": _quenched,
    "slow heat": partial(_quenched, D=5e-3),
    "heat at rest": partial(_quenched, solver="static", time_step=1e-7, steps=4, every=1, ledger=1),
    "fatigue": partial(_tiring, Fatigue(A=1e9, m=3.0, A1=1e8, m1=4.0), (16, 12)),
    "fatigue by K": partial(_tiring, Fatigue(C=1e-30, m=3.0), (40, 30), cracks="particles", particles=ParticleRules()),
    "body": partial(_of, {}, counts=(10, 10, 6)),
    "body, ordinary": partial(_of, {"model": "ordinary", "nu": 0.22}, counts=(10, 10, 6)),
    "diffusion": partial(_diffusing, Medium(D=1.0)),
    "dissolution": partial(_diffusing, SALT),
    "dissolution, kinetic": partial(_diffusing, KINETIC),
    "dissolution, implicit": partial(_diffusing, SALT, solver="implicit", time_step=1e-6),
}
