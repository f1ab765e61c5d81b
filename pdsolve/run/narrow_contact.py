"""A warning of round bodies at rest that touch more narrowly than their nodes resolve."""

from __future__ import annotations

from typing import cast

from pdsolve.checks import warn
from pdsolve.operators.contact.at_rest import RestingContact
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
