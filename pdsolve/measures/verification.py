"""Checks that a database of results holds what was written to it and that its parts agree."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.amounts import pair_count
from pdsolve.measures.balance import mass_balance
from pdsolve.measures.embedded_model import run_of
from pdsolve.measures.frame_steps import frames
from pdsolve.results import DamagedError, Results

CLOSE = 1e-9  # of a time: round-off
FIELDS_CLOSE = 1e-4  # of a sum over float32
MASS_CLOSE = 1e-6  # of the substance there is


class DatabaseContents(NamedTuple):
    """Contents of a database that has been read and found consistent."""

    node_count: int  # at the end
    bond_count: int  # pairs of nodes, at their births
    broken_bond_count: int  # of them
    frame_count: int
    field_count: int  # of the last frame
    last_step: int  # step of the ledger
    status: str
    schema_version: int
    has_checksums: bool  # whether the file has some: the oldest ones have none


def verify_database(results: Results) -> DatabaseContents:
    """Read and check everything. Raises ResultsError naming the error and its place."""
    results.verify(older=True)
    meta, (steps, times) = results.meta(), frames(results)
    run = run_of(results)
    marches = run.solver != "static"
    ledger = results.history() if len(results.history()) else results.masses()
    _expect_ordered_steps(results, ledger, steps)
    if marches:
        for table, step, time in (("frame", steps, times), ("the ledger", ledger["step"], ledger["time"])):
            _expect_times_match_steps(results, table, step, time, float(meta["time_step"]))
    odd = steps[:-1][steps[:-1] % run.frame_interval != 0]
    if len(odd):
        raise DamagedError(
            f"{results.name}: there is a frame at step {odd[0]}; frames are every {run.frame_interval} steps"
        )
    for step in steps.tolist():
        for name in results.stored(step):
            results.field(name, step)
    families, breaks = results.families(), results.breaks()
    if len(results.epochs()) == 1:
        _expect_consistent_bonds(results)
        _expect_consistent_energies(results)
    if len(results.masses()):
        error = mass_balance(results).error
        off = ~(np.abs(error) <= MASS_CLOSE)
        if off.any():
            step = results.masses()["step"][off.argmax()]
            raise DamagedError(f"{results.name}: table mass: {error[off][0]:+.1e} of it is missing at step {step:g}")
    status = str(meta.get("status", ""))
    if status == "finished" and not results.summary():
        raise DamagedError(f"{results.name}: it is finished without a summary; every finished run has one")
    return DatabaseContents(
        len(results.nodes().ids),
        pair_count(len(families.neighbour)),
        pair_count(len(breaks.step)),
        len(steps),
        len(results.stored(int(steps[-1]))),
        int(ledger["step"][-1]) if len(ledger) else int(steps[-1]),
        status,
        results.version,
        results.checked,
    )


def _expect_ordered_steps(results: Results, ledger: NDArray[np.void], steps: NDArray[np.int64]) -> None:
    booked = ledger["step"].astype(np.int64)
    back = np.flatnonzero(np.diff(booked) <= 0)
    if len(back):
        raise DamagedError(f"{results.name}: energy balance: step {booked[back[0] + 1]} comes after {booked[back[0]]}")
    missing = np.setdiff1d(steps, booked)
    if len(booked) and len(missing):
        raise DamagedError(
            f"{results.name}: energy balance: there is no entry of step {missing[0]}; every frame has one"
        )


def _expect_times_match_steps(
    results: Results, table: str, step: NDArray[np.generic], time: NDArray[np.float64], time_step: float
) -> None:
    """Raise ResultsError unless the times (t,), s, are those of the steps (t,)."""
    off = np.abs(time - np.asarray(step, dtype=float) * time_step) > CLOSE * np.maximum(np.abs(time), time_step)
    if off.any():
        at = int(off.argmax())
        raise DamagedError(
            f"{results.name}: {table}: time is {time[at]:g} s at step {int(step[at])}; steps are of {time_step:g} s"
        )


def _expect_consistent_bonds(results: Results) -> None:
    """Raise ResultsError unless each broken bond exists and broke once, and damage and ledger count the same bonds."""
    nodes, families, breaks, ledger = results.nodes(), results.families(), results.breaks(), results.history()
    count, order = len(nodes.ids), np.argsort(nodes.ids)
    node, neighbour = (order[np.searchsorted(nodes.ids, ids, sorter=order)] for ids in breaks[1:])
    bonds = np.repeat(np.arange(count), np.diff(families.start)) * count + families.neighbour
    torn = node * count + neighbour
    strange = ~np.isin(torn, bonds)
    if strange.any() or len(np.unique(torn)) < len(torn):
        at = int(strange.argmax())
        raise DamagedError(
            f"{results.name}: table bond_break: the bond of {breaks.node[at]} and {breaks.neighbour[at]} is of no"
            " family, or breaks twice"
        )
    for step, broken in zip(ledger["step"].tolist(), ledger["broken"].tolist(), strict=True):
        rows = int(np.searchsorted(breaks.step, step, side="right"))
        if broken != rows:
            raise DamagedError(
                f"{results.name}: energy balance: {broken:g} bonds are broken at step {step:g}; the table bond_break"
                f" has {rows}"
            )
    for step in results.frames()[0].tolist() if len(ledger) else ():
        if "damage" not in results.stored(step):
            continue
        broken_count = np.bincount(node[breaks.step <= step], minlength=count) + nodes.cut
        expected = np.where(nodes.family > 0, broken_count / np.maximum(nodes.family, 1), 0.0)
        off = np.abs(results.field("damage", step) - expected) > 1e-6
        if off.any():
            raise DamagedError(
                f"{results.name}: damage of node {nodes.ids[off.argmax()]} at step {step} is"
                f" {results.field('damage', step)[off][0]:g}; its broken bonds give {expected[off][0]:g}"
            )


def _expect_consistent_energies(results: Results) -> None:
    """Raise ResultsError unless the energies of the nodes add up to the ledger's."""
    ledger, nodes = results.history(), results.nodes()
    for step in results.frames()[0].tolist() if len(ledger) else ():
        if "energy" not in results.stored(step):
            continue
        entry = ledger[ledger["step"] == step][0]
        node_energy = float(nodes.area @ results.field("energy", step).astype(float))
        most = max(abs(float(entry["strain"])), abs(node_energy), FIELDS_CLOSE * abs(float(entry["work"])))
        if not abs(node_energy - entry["strain"]) <= FIELDS_CLOSE * most:
            raise DamagedError(
                f"{results.name}: strain energy of the nodes at step {step} is {node_energy:g}; the energy balance has"
                f" {entry['strain']:g}"
            )
