"""A struck plate of any law, with a fine zone that moves and with the fine lattice everywhere.

As a program it takes the name of a law, one of one's own too, which no kernel on disk may know.
"""

from __future__ import annotations

import json
import sys
import warnings
from typing import NamedTuple

import curved_law
import numpy as np
from zoned_plates import side_by_side, struck

from pdsolve.laws import LAWS
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

STEPS = 170


class Struck(NamedTuple):
    """What a plate with a fine zone came to, beside the plate with the fine lattice everywhere."""

    first_steps: list[int]  # in which a bond broke first
    broken: int  # bonds, of the fine lattice
    dissipated: float  # energies over those of the fine lattice
    work: float
    balance: float
    continues_alike: bool  # whether a run that is restored halfway has the same bits at the end


def strike(law: str) -> Struck:
    """Strike the plate."""
    if law in curved_law.OWN:
        LAWS[law] = curved_law.OWN[law]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        zone, uniform = side_by_side(struck("hybrid", STEPS, law))
        return Struck(
            [zone.first, uniform.first],
            uniform.books.broken,
            zone.books.dissipated / uniform.books.dissipated,
            zone.books.work / uniform.books.work,
            zone.balance,
            continues_alike(law),
        )


def continues_alike(law: str, half: int = 80) -> bool:
    """Whether a run that is restored after `half` of its steps ends with the bits of one that is not."""
    problems = [prepare(struck("hybrid", 2 * half, law), Options(threads=1)) for _ in range(2)]
    engines = []
    for problem in problems:
        operator = problem.system.moving_zone_operator
        assert operator is not None
        engines.append(operator.engine)
    problems[0].advance(1, half + 1)
    checkpoint = {name: values.copy() for name, values in engines[0].checkpoint_arrays().items()}
    engines[1].restore(checkpoint)
    for engine in engines:
        engine.advance(half + 1, 2 * half + 1)
    one, other = (engine.checkpoint_arrays() for engine in engines)
    return all(np.array_equal(values, other[name]) for name, values in one.items())


if __name__ == "__main__":
    print(json.dumps(strike(sys.argv[1])))
