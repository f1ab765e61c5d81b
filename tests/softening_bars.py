"""Beams and bars of softening bonds at rest, and where their bonds have spent energy."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from plates import plate, square_grid

from pdmesh.model.document import Condition, Displacement, Load, Material, Region, Run, Static
from pdmesh.model.node_grid import Grid
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.operators.softening_bonds import SofteningBonds
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate
from pdsolve.schemes import SCHEMES

RAMP = ((0.0, 0.0), (1.0, 1.0))
CONCRETE = Material(E=30e9, rho=2400, G0=100, law="cohesive", f_t=3e6, shape="linear", micromodulus="constant")

PETERSSONS = Material(
    E=30e9, rho=2400, G0=124, law="cohesive", f_t=3.33e6, shape="bilinear", micromodulus="constant"
)  # of Petersson's beams
WIDTH = 0.05  # m, of Petersson's beams


class Spent(NamedTuple):
    """Energy of bonds, J/m."""

    crossing: float  # spent by those that cross x = 0
    elsewhere: float
    left: float  # still to be spent by those that cross


def spent(model: Model, results: Results) -> Spent:
    """Where energy went, followed through all frames of a path."""
    bonds = SofteningBonds(law_of(model), SCHEMES["conservative"].fill(model).whole())
    for step in results.frames()[0].tolist():
        value = np.column_stack([results.field(name, step) for name in ("ux", "uy")]).astype(float)
        bonds.kappa[:] = bonds.respond(value).kappa
    x = model.grid.position[:, 0]
    cross = x[bonds.source] * x[bonds.target] < 0
    energy, all_of_it = (
        bonds.dissipated_energy(bonds.kappa),
        bonds.dissipated_energy(np.where(np.isfinite(bonds.limit), bonds.limit, 0.0)),
    )
    return Spent(*(float(part.sum()) for part in (energy[cross], energy[~cross], (all_of_it - energy)[cross])))


def bar() -> Model:
    """0.2 x 0.1 m, pulled at its ends, its middle 3 % weaker."""
    h = 0.01
    grid = square_grid(20, 10, h, x0=h / 2 - 0.1, y0=h / 2)
    x = grid.position[:, 0]
    ends = [tuple((np.flatnonzero(side * x > 0.1 - h) + 1).tolist()) for side in (-1, 1)]
    weak = tuple((np.flatnonzero(np.abs(x) < h) + 1).tolist())
    conditions: tuple[Condition, ...] = (
        Displacement(nodes=ends[0], x=0.0),
        Displacement(nodes=ends[0][:1], y=0.0),
        Displacement(nodes=ends[1], x=1.5e-4, profile=RAMP),
    )
    regions = (Region(nodes=weak, material=msgspec.structs.replace(CONCRETE, f_t=0.97 * 3e6)),)
    run = Run(solver="static", static=Static(load_steps=30))
    return plate(grid, 3, material=CONCRETE, conditions=conditions, run=run, regions=regions)


def beam(h: float, by: str = "displacement", load_steps: int | None = None) -> Model:
    """A beam of 2 x 0.2 m with a notch of half its height, on single nodes, as P.-E. Petersson, TVBM-1006 (1981)."""
    grid = square_grid(round(2 / h), round(0.2 / h), h, x0=h / 2 - 1, y0=h / 2)
    grid = dataclasses.replace(grid, cracks=np.array([[0, -0.01, 0, 0.1]]))
    x, y = grid.position.T
    low, middle = np.flatnonzero(y < h), np.flatnonzero((np.abs(x) < h) & (y > 0.2 - h))
    ends = [int(low[x[low].argmin()]) + 1, int(low[x[low].argmax()]) + 1]
    conditions: list[Condition] = [Displacement(nodes=ends[:1], x=0.0, y=0.0), Displacement(nodes=ends[1:], y=0.0)]
    if by == "load":
        force = 1000 / WIDTH / len(middle) / h**2
        conditions.append(
            Load(nodes=tuple((middle + 1).tolist()), body_force=(0.0, -force), profile=RAMP, breakable=True)
        )
    else:
        conditions.append(Displacement(nodes=(int(middle[0]) + 1,), y=-2e-3, profile=RAMP, breakable=True))
    run = Run(solver="static", static=Static(load_steps=load_steps))
    return plate(grid, 3, material=PETERSSONS, conditions=tuple(conditions), run=run)


def steady_drive() -> NDArray[np.float64]:
    """The energy (t,) that a long strip offers its crack, over G_f, while the crack runs through its middle.

    0.3 x 0.08 m, 5 mm between nodes, held at both long edges, which are moved apart; l_ch is four spacings. A strip of
    height H between its edges offers E / (1 - nu^2) (u / H)^2 H / 2, where they are moved apart by u.
    """
    h, rows = 0.005, 16
    grid = square_grid(60, rows, h, x0=h / 2, y0=(1 - rows) * h / 2)
    grid = dataclasses.replace(grid, cracks=np.array([[-1.0, 0, 0.1, 0]]))
    material = msgspec.structs.replace(CONCRETE, f_t=float(np.sqrt(CONCRETE.E * CONCRETE.G0 / (4 * h))))
    y = grid.position[:, 1]
    edges = [tuple((np.flatnonzero(side * y > rows * h / 2 - h) + 1).tolist()) for side in (-1, 1)]
    conditions = tuple(
        Displacement(nodes=nodes, x=0.0, y=side * 5e-5, profile=RAMP)
        for side, nodes in zip((-1, 1), edges, strict=True)
    )
    run = Run(solver="static", static=Static(load_steps=40))
    model = plate(grid, 3, material=material, conditions=conditions, run=run)
    with simulate(model, None, Options(threads=1)) as results:
        table, grown = results.reactions(), results.history()["dissipated"] / CONCRETE.G0
    moved, H = 2 * table["displacement_y"][table["condition"] == 1], (rows - 1) * h
    drive = CONCRETE.E / (1 - 1 / 9) * (moved / H) ** 2 * H / 2 / CONCRETE.G0
    return np.asarray(drive[(grown > 0.06) & (grown < 0.13)])


def turned_beam(degrees: float, spacing: float = 0.0066) -> Model:
    """0.4 x 0.1 m with a notch of 0.03 m in its middle, in three-point bending, on a lattice turned by an angle."""
    length, height = 0.4, 0.1
    turn, many = np.radians(degrees), round(1.2 * length / spacing)
    i, j = np.mgrid[-many : many + 1, -many : many + 1]
    place = (np.column_stack([i.ravel(), j.ravel()]) + np.array([0.5, 0.47])) * spacing
    place = place @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    place = place[(np.abs(place[:, 0]) <= length / 2) & (place[:, 1] > 0) & (place[:, 1] < height)]
    nodes = len(place)

    def nearest(x: float, y: float) -> tuple[int]:
        return (int(np.hypot(*(place - [x, y]).T).argmin()) + 1,)

    grid = Grid(
        ids=np.arange(1, nodes + 1),
        position=place,
        delta=np.full(nodes, spacing),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=np.array([[1.3e-4, -1, 1.3e-4, 0.03]]),
    )
    conditions: tuple[Condition, ...] = (
        Displacement(nodes=nearest(-length / 2, 0), x=0.0, y=0.0),
        Displacement(nodes=nearest(length / 2, 0), y=0.0),
        Displacement(nodes=nearest(0, height), y=-6e-4, profile=RAMP, breakable=True),
    )
    run = Run(solver="static", static=Static(load_steps=12))
    return plate(grid, 3, material=CONCRETE, conditions=conditions, run=run)


def lean(model: Model, results: Results) -> tuple[float, float]:
    """Degrees by which the crack of a beam leaves the upright, and the farthest it comes from the middle, m.

    The crack is where nodes part best by their motion along x, between 35 and 80 mm above the beam's foot.
    """
    position, last = model.grid.position, int(results.frames()[0][-1])
    moved, levels, places = results.field("ux", last), np.arange(0.035, 0.085, 0.005), []
    for level in levels:
        row = np.abs(position[:, 1] - level) < 0.005
        x, ux = position[row, 0], moved[row]
        right = ux > (ux[x < -0.05].mean() + ux[x > 0.05].mean()) / 2
        cuts = np.linspace(-0.06, 0.06, 241)
        wrong = ((x[None, :] > cuts[:, None]) != right).sum(axis=1)
        places.append(cuts[wrong == wrong.min()].mean())
    slope = np.polyfit(levels, places, 1)[0]
    return float(np.degrees(np.arctan(slope))), float(np.abs(places).max())


def load(results: Results, condition: int) -> NDArray[np.float64]:
    """The size of a condition's force along y at each step, N/m."""
    table = results.reactions()
    return np.asarray(np.abs(table["force_y"][table["condition"] == condition]))
