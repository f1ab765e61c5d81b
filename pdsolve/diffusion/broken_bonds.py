"""Bonds that break in the motion and conduct less from then on.

A pair of nodes whose bond broke keeps a share of the conductance that it had, that of the surface correction included.
Walls that prescribe a value keep all of theirs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.diffusion.families import DiffusionFamilies
from pdsolve.diffusion.system import Transport
from pdsolve.lattice.flux_operator import FluxesInList, links_between
from pdsolve.state import Broken
from pdsolve.steppers.theta import ThetaSteps


class BrokenBonds:
    """What the broken bonds of a motion, of the same n nodes, take from a transport."""

    def __init__(self, transport: Transport, broken: Callable[[], Broken], share: float) -> None:
        """`broken` returns the bonds that are broken now; each keeps a `share`, from 0 to 1, of its conductance."""
        self._transport, self._broken, self._share = transport, broken, share
        self._families, self._known = DiffusionFamilies(transport.model), 0

    def update(self, stepper: object) -> None:
        """Let the bonds that are broken now conduct less, in the steps of `stepper` too."""
        broken = self._broken()
        if len(broken.step) == self._known:
            return
        self._known = len(broken.step)
        order = np.lexsort((broken.target, broken.source))
        source, target = broken.source[order], broken.target[order]
        lost = (self._share - 1) * self._conductance(source, target)
        is_reduced, operator = lost < 0, self._transport.operator
        links = links_between(source[is_reduced], target[is_reduced], len(operator.volume))
        operator.torn = FluxesInList(links, lost[is_reduced], operator.volume, self._transport.threads)
        if isinstance(stepper, ThetaSteps):
            stepper.discard_factors()

    def _conductance(self, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.float64]:
        """Conductance (b,) of these pairs while they are whole, 1/(s m^d); 0 where nothing diffuses."""
        conductance, change = self._families.between(source, target), self._transport.operator.change
        if change is None:
            return conductance
        (start, neighbour, _), more, nodes = change.links, change.conductance, len(change.volume)
        keys = np.repeat(np.arange(nodes), np.diff(start)) * nodes + neighbour
        wanted = source * nodes + target
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1) if len(keys) else np.zeros(0, dtype=np.int64)
        return conductance + np.where(keys[at] == wanted, more[at], 0.0) if len(keys) else conductance
