"""Fluxes between the nodes of a lattice on a device."""

from __future__ import annotations

import numpy as np

from pdsolve.device.families import arrays_of, family_source, first_pass_of
from pdsolve.device.nodes import NodesOnDevice
from pdsolve.device.runtime import Session
from pdsolve.device.tracing import Code
from pdsolve.lattice.flux_operator import Array, FluxesInList, FluxesInTiles
from pdsolve.lattice.fluxes import share_of
from pdsolve.laws.bond_arrays import Ends
from pdsolve.laws.fluxes import Conduction


class FluxesOnDevice(NodesOnDevice):
    """The fluxes of n nodes whose steps a device takes; see `pdsolve.steppers.steps_on_device`."""

    scheme = ("FIRST_ORDER", "FLUXES")

    def __init__(
        self, fluxes: FluxesInTiles, change: FluxesInList | None, outside: Array, C_sat: float | None, session: Session
    ) -> None:
        """Arguments are those of `pdsolve.diffusion.operator.Fick`; potentials are at most `C_sat`, mol/m^3, if it is
        given. Raises ModelError for a device with too little memory."""
        nodes = len(fluxes.volume)
        self._tiles, self._C_sat = fluxes.tiles, C_sat
        self.dimension, self.room, self.place = 1, fluxes.sites.size, fluxes.sites.site
        arrays = arrays_of(fluxes.tiles) | {"node": self.spread(np.arange(nodes, dtype=np.int32), -1)}
        arrays |= {"total": self.spread(fluxes.total), "outside": self.spread(outside)}
        arrays |= {"more_start": np.zeros(nodes + 1, np.int64), "more_site": self.place[:0], "more": np.zeros(0)}
        arrays |= {"more_total": np.zeros(self.room), "dissipated": np.zeros(self.room)}
        if change is not None:
            arrays |= {"more_start": change.links.start, "more_site": self.place[change.links.neighbour]}
            arrays |= {"more": change.conductance, "more_total": self.spread(change.total)}
        self.upload(session, arrays)

    def source(self) -> str:
        """What the bonds are in OpenCL C."""
        code, law = Code(), Conduction(self._tiles.g)
        D, D_of_neighbour = (code.named(f"D[{end}]", 1) for end in ("i", "*j"))
        defined = first_pass_of(law, code, Ends((), code.named("u[j]", 1)), 1, D)
        defined["SHARE"] = code.statements("c[0] = c[0] * {1};", (share_of(*D, *D_of_neighbour),))
        defined["POTENTIAL(h)"] = "h" if self._C_sat is None else f"fmin(h, {float(self._C_sat).hex()})"
        return self.declarations + "\n" + family_source(self._tiles, defined)
