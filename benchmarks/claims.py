"""What the thesis says of its scenes, what is accepted as a reproduction, and how it is measured.

A. De Checchi, University of Padua 2012/13. "Claimed" is the thesis's own word. "Accepted" is the range around an
independent computation of the same scene; the loads of the oblique crack, the plate with a hole and the V-notch
are calibrated, as the thesis leaves them out. Steps and lengths in the units printed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pdmesh.model.cracked_damage import CRACKED
from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.measures.cracks import DIRECTIONS, CrackEvents, find_crack_events
from pdsolve.measures.directions import measure_initial_directions
from pdsolve.measures.tips import crack_branches, find_forks
from pdsolve.results import Results


@dataclass(frozen=True)
class Claim:
    """One number of one scene."""

    what: str
    claimed: str
    low: float
    high: float
    measure: Callable[[Results, CrackEvents], float]  # not a number where it did not happen

    def accepts(self, value: float) -> bool:
        """Whether a measured value is a reproduction."""
        return bool(self.low <= value <= self.high)

    @property
    def accepted(self) -> str:
        """The range as text."""
        return f"{self.low:.4g} to {self.high:.4g}"


@dataclass(frozen=True)
class Case:
    """A scene of the thesis: what is solved, what is drawn, what is claimed."""

    name: str
    title: str
    scene: str  # a file in geometries/
    claims: tuple[Claim, ...]
    pictures: tuple[int, ...] = ()  # steps of damage pictures, the thesis's own
    parameters: tuple[tuple[str, str], ...] = ()  # of the drawing, set before it is read
    along: str = "right"
    noise: float = 0.0  # m, added to the places of the nodes
    long: bool = False  # too long for a quick test


def _of(event: str, quantity: str, factor: float = 1.0) -> Callable[[Results, CrackEvents], float]:
    return lambda _, events: np.nan if (at := getattr(events, event)) is None else factor * getattr(at, quantity)


def _apart(results: Results, _: CrackEvents) -> float:
    """When all arms of the first fork have left it, us: only then does a picture show them."""
    branches = crack_branches(results)
    for fork in find_forks(branches)[:1]:
        arms = (branch for branch in branches if tuple(branch.points[0].tolist()) == fork.place)
        return max(float(arm.passing_time[1]) for arm in arms) * 1e6
    return np.nan


def _angle(results: Results, _: CrackEvents) -> float:
    """Mean of the angles of the cracks from the two notches, each as a whole, away from each other."""
    return float(
        np.mean(
            [abs(way.overall_angle) for way in measure_initial_directions(results, crack_branches(results))] or [np.nan]
        )
    )


def _width(step: int) -> Callable[[Results, CrackEvents], float]:
    """Width of all that is cracked, mm."""

    def width(results: Results, _: CrackEvents) -> float:
        x = results.nodes().position[damage_without_pre_cracks_at(results, step) > CRACKED, 0]
        return float(np.ptp(x)) * 1e3

    return width


def _furthest(step: int, direction: str, sign: float = 1.0) -> Callable[[Results, CrackEvents], float]:
    """How far the cracked nodes reach, mm."""

    def furthest(results: Results, _: CrackEvents) -> float:
        cracked = results.nodes().position[damage_without_pre_cracks_at(results, step) > CRACKED]
        return sign * float((cracked @ np.array(DIRECTIONS[direction])).max(initial=-np.inf)) * 1e3

    return furthest


def _glass(
    start: float, branch: float, place: str, accepted: tuple[float, float, float, float, float, float]
) -> tuple[Claim, ...]:
    return (
        Claim("start of propagation, µs", f"about {start:g}", accepted[0], accepted[1], _of("start", "time", 1e6)),
        Claim("branching, µs", f"about {branch:g}", accepted[2], accepted[3], _apart),
        Claim("place of branching, mm", place, accepted[4], accepted[5], _of("branching", "along", 1e3)),
    )


DURAN = _glass(10, 29, "68", (8.5, 11.5, 26, 32, 65, 75))
SODA_LIME = _glass(8, 27, "68", (6.5, 9.5, 24, 30, 66, 78))

CASES = (
    Case("duran50", "Duran 50 glass, 12 MPa, two scales", "duran50.geo", DURAN, (1400, 1700)),
    Case("duran50_one_scale", "Duran 50 glass, 12 MPa, one scale", "duran50_one_scale.py", DURAN, (1400, 1700)),
    Case("soda_lime", "Soda-lime glass, 12 MPa, two scales", "soda_lime.geo", SODA_LIME, (1100, 1600)),
    Case(
        "soda_lime_one_scale",
        "Soda-lime glass, 12 MPa, one scale",
        "soda_lime_one_scale.py",
        SODA_LIME,
        (1100, 1600),
        long=True,
    ),
    Case(
        "duran50_24MPa",
        "Duran 50 glass, 24 MPa: two generations of branches in the thesis, not symmetric",
        "duran50.geo",
        (),
        (1100,),
        (("Loads/top/Traction y", "24e6"), ("Loads/bottom/Traction y", "-24e6"), ("Run/Duration", "27.5e-6")),
        long=True,
    ),
    Case(
        "duran50_24MPa_noise",
        "The same with the nodes moved at random by 1 nm",
        "duran50.geo",
        (),
        (1100,),
        (("Loads/top/Traction y", "24e6"), ("Loads/bottom/Traction y", "-24e6"), ("Run/Duration", "27.5e-6")),
        noise=1e-9,
        long=True,
    ),
    Case(
        "kalthoff_winkler",
        "Kalthoff and Winkler's experiment, two scales",
        "kalthoff_winkler.geo",
        (Claim("angle of the cracks, degrees", "about 68", 65, 71, _angle),),
        (200, 300, 400, 500),
    ),
    Case(
        "kalthoff_winkler_one_scale",
        "Kalthoff and Winkler's experiment, one scale",
        "kalthoff_winkler.geo",
        (Claim("angle of the cracks, degrees", "about 68", 64, 70, _angle),),
        (500,),
        (("Zones/coarse/Spacing", "1e-3"),),
        long=True,
    ),
    Case(
        "oblique_crack",
        "Oblique crack",
        "oblique_crack.geo",
        (
            Claim("first broken bond, step", "240", 0.88 * 240, 1.12 * 240, _of("first_break", "step")),
            Claim("width cracked at step 300, mm", "half of 30", 0.88 * 12.5, 1.12 * 12.5, _width(300)),
            Claim("split, step", "450", 0.88 * 450, 1.12 * 450, _of("split", "step")),
        ),
        (240, 300, 450),
        long=True,
    ),
    Case(
        "plate_with_hole",
        "Plate with a hole",
        "plate_with_hole.geo",
        (
            Claim("start of the cracks, step", "about 250", 0.85 * 250, 1.15 * 250, _of("start", "step")),
            Claim("left tip at step 500, mm", "half of 17", 0.88 * 10.5, 1.12 * 10.5, _furthest(500, "left", -1.0)),
            Claim("split, step", "before 699", 500, 699, _of("split", "step")),
        ),
        (300, 500, 699),
    ),
    Case(
        "v_notch",
        "Plate with a V-notch",
        "v_notch.geo",
        (
            Claim("start of the crack, step", "480", 0.88 * 480, 1.12 * 480, _of("start", "step")),
            Claim("tip at step 699, mm", "half of 40", 0.88 * 20, 1.12 * 20, _furthest(699, "down", -1.0)),
            Claim("branching, step", "about 970", 0.88 * 970, 1.12 * 970, _of("branching", "step")),
            Claim(
                "place of branching, mm above the lower edge", "a quarter of 40", 8, 12, _of("branching", "along", -1e3)
            ),
        ),
        (480, 699, 970),
        (("Run/Duration", "32.5e-6"),),  # its arms are too short to be told from a rough edge before
        along="down",
        long=True,
    ),
)


def measured(case: Case, results: Results) -> list[float]:
    """The case's numbers as this run has them."""
    events = find_crack_events(results, DIRECTIONS[case.along])
    return [claim.measure(results, events) for claim in case.claims]
