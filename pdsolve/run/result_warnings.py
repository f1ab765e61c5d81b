"""Warnings that follow from what a run has computed: contact, breaks and plastic strain that are not resolved."""

from __future__ import annotations

import warnings
from typing import cast

import numpy as np

from pdmesh.model.zone_strengths import coarse_nodes, of_body, weakest_zones
from pdsolve.checks import named, warn
from pdsolve.model import Model, ModelWarning
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.together import unwrap_bond_operator
from pdsolve.results import Results
from pdsolve.run.system import System
from pdsolve.state import State

RESOLVED = 4.0  # spacings: half-width from which on it is Hertz's


def warn_of_unresolved_contact_width(system: System, state: State) -> None:
    """Warn of the narrowest contact of two round bodies under the largest force of a run at rest."""
    contact, bodies = system.contact, system.model.grid.bodies
    if contact is None or bodies is None or system.model.settings.run.solver != "static":
        return
    contact = cast("RestingContact", contact)  # as at rest
    contact.measure_widths(state)
    narrow = {pair: width.half for pair, width in contact.widths.items() if width.half < RESOLVED}
    if narrow:
        (first, second), half = min(narrow.items(), key=lambda item: item[1])
        warn(
            system.model,
            f"$.bodies: '{bodies.names[first]}' and '{bodies.names[second]}' touch over a half-width of {half:.1f}"
            f" spacings, less than the {RESOLVED:g} of round bodies: the width and the pressure of a narrower"
            " contact are not resolved; use a finer spacing",
        )


def warn_of_broken_bonds_outside_finest_zone(model: Model, results: Results) -> None:
    """Warn for each body of broken bonds of nodes coarser than its finest, which had less strength."""
    grid, weakest_zone_of_each = model.grid, weakest_zones(model.grid, model.settings)
    if not weakest_zone_of_each:
        return
    breaks, order = results.breaks(), np.argsort(grid.ids)
    rows, other_rows = (order[np.searchsorted(grid.ids, ids, sorter=order)] for ids in (breaks.node, breaks.neighbour))
    for weakest in weakest_zone_of_each:
        coarse = coarse_nodes(grid, weakest)
        outside = np.flatnonzero(coarse[rows] | coarse[other_rows])
        if len(outside):
            first = outside[0]
            warn(
                model,
                f"{len(outside) / len(breaks.step):.0%} of the broken bonds are outside the finest zone"
                f"{of_body(weakest.body)}, where strength is down to {weakest.share:.2g} of that within; the first"
                f" broke at step {breaks.step[first]}, {named(model, int(rows[first]))}; widen the fine zone, or set"
                ' material.coarse to "matched" or "unbreakable"',
            )


LARGEST = 0.1  # plastic strain up to which j2 in its total form counts as one for small strains


def warn_if_plastic_strain_is_large(system: System, step: int) -> bool:
    """Warn if the equivalent plastic strain of a node is above `LARGEST`; returns whether one is."""
    solid = getattr(getattr(unwrap_bond_operator(system.operator), "columns", None), "solid", None)
    if solid is None:
        return False
    p = solid.history[:, :6].astype(float)
    largest = float(np.sqrt(2 / 3 * ((p[:, :3] ** 2).sum(axis=1) + 2 * (p[:, 3:] ** 2).sum(axis=1))).max(initial=0.0))
    if largest <= LARGEST:
        return False
    warnings.warn(
        f"{system.model.name}: step {step}: the plastic strain is {largest:.3g}, more than {LARGEST:g}, and j2 is"
        " for small strains: stress and volume are wrong; use material.form = 'rate' for large ones",
        ModelWarning,
        stacklevel=2,
    )
    return True
