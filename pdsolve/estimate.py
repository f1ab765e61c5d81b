"""What a run of a model would take: the one estimate of `pdsolve --dry-run`, `pdmesh plan` and `pdmesh info`.

Bonds and steps are those of the run. Memory and time are measured rules, `make bench-speed` says how well they hold;
time is that of the machine they were measured on, over how fast this one multiplies.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from pdmesh.model.document import Run
from pdsolve.checks import advise
from pdsolve.laws import PAIRS, law_of
from pdsolve.model import Model
from pdsolve.system import Options, Survey, prepare, scheme_of, stable, step_of, threads_of

DEFAULT = Options()

# Peak of the whole process, bytes: at least, half of it libraries' files, of which systems map more or less; and for
# each node
MEMORY = {"thesis": (196e6, 1450.0), "conservative": (181e6, 1450.0)}
LISTED = 130.0  # bytes for each bond of a law that is no pair's
# Seconds: of a bond and of a node in a step on one thread, breaking included; of a bond of another law; of an entry of
# the ledger and of a frame, each at least, and for each bond or node; of the beginning
BOND = {"float64": 0.35e-9, "float32": 0.2e-9}
NODE = {"float64": 9.5e-9, "float32": 6e-9}
LISTED_BOND = 12e-9
SHARED = 0.5  # of more threads' work that another thread takes over
LEDGER, LEDGER_BOND = 0.5e-3, 4e-9
FRAME, FRAME_NODE = 0.3e-3, 1.5e-7
BEGIN, BEGIN_NODE = 0.06, 3e-6
PRODUCTS, ROUNDS, REFERENCE = 4096, 3000, 0.84e-6  # s of so many products where that was measured


class Plan(NamedTuple):
    """What a run would take."""

    nodes: int
    bonds: int  # directed, at the start
    steps: int
    time_step: float  # s
    stable_time_step: float  # s
    memory: int  # bytes of the process at its peak
    wall_time: float  # s of the time loop, with its ledger and frames


def plan(model: Model, options: Options = DEFAULT) -> Plan:
    """What solving the model would take; of a fine zone that moves, while it is as at the start. Raises ModelError."""
    scheme = scheme_of(model, options)
    moves = model.settings.run.adapt == "hybrid"
    if law_of(model) in PAIRS and not moves:
        survey = Survey(scheme.fill(model), scheme.symmetric)
        for _ in survey.parts():
            pass
        count, bound = survey.count, stable(survey.stiffest, model.rho)
        step = step_of(model, bound)
    else:
        system = prepare(model, options).system
        model, count, bound, step = system.model, system.count, system.bound, system.time_step
    advise(model, count, scheme.partial_cells, scheme.symmetric)
    options = options._replace(threads=1) if moves else options
    paired = law_of(model) in PAIRS
    return priced(model.settings.run, options, len(model.grid), int(count.sum()), (step, bound), paired)


def priced(run: Run, options: Options, nodes: int, bonds: int, steps: tuple[float, float], paired: bool = True) -> Plan:
    """The same, for so many nodes and bonds; `steps` are that of the run and the one that is surely stable, s."""
    least, each = MEMORY[options.mode]
    memory = least + each * nodes + (0 if paired else LISTED * bonds)
    threads = threads_of(options, nodes, paired)
    update = bonds * BOND[options.precision] + nodes * NODE[options.precision] if paired else bonds * LISTED_BOND
    ledgers, frames = run.steps / (run.ledger or run.every), run.steps / run.every
    seconds = run.steps * update / (1 + SHARED * (threads - 1))
    seconds += ledgers * (LEDGER + LEDGER_BOND * bonds) + frames * (FRAME + FRAME_NODE * nodes)
    seconds = slower() * (seconds + BEGIN + BEGIN_NODE * nodes)
    return Plan(nodes, bonds, run.steps, *steps, round(memory), seconds)


def slower() -> float:
    """How much longer this machine takes to multiply than the one measured."""
    values, best = np.full(PRODUCTS, 0.999), float("inf")
    for _ in range(ROUNDS):
        began = time.perf_counter()
        np.multiply(values, values, out=values)
        best = min(best, time.perf_counter() - began)
    return best / REFERENCE
