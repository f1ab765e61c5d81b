"""Forward Euler of diffusion on a device, to the same bits as on the processor: contents stay there between records."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive, Entries, put_loads
from pdsolve.device.factors import AT_ONCE, Factors
from pdsolve.device.runtime import Session
from pdsolve.device.source import preamble, text_of
from pdsolve.device.translation import DOUBLE, Translation
from pdsolve.diffusion.dissolution import saturated
from pdsolve.diffusion.lattice import OnLattice
from pdsolve.diffusion.listed import BondList
from pdsolve.diffusion.operator import Fick
from pdsolve.lattice.fluxes import share_of
from pdsolve.lattice.layout import LANES
from pdsolve.model import ModelError
from pdsolve.state import State


class EulerOnDevice:
    """Takes steps on a device; the state on the host is that of the last `download_state`; it may be changed then."""

    def __init__(self, operator: Fick, state: State, drive: Drive, dt: float, session: Session) -> None:
        """Steps of `dt`, s. Raises ModelError for nodes on no lattice, or a device with too little memory."""
        self.session, self._drive, self._state, self._dt = session, drive, state, dt
        lattice, nodes = operator.exchange, len(operator.volume)
        if not isinstance(lattice, OnLattice):
            raise ModelError("$.run.device: nodes are on no lattice; use cpu, or nodes on one")
        tiles, sites = lattice.tiles, lattice.sites
        self._nodes, self._ahead, self._last = nodes, False, 0
        self._size = -(-nodes // LANES) * LANES
        fixed: list[NDArray[Any]] = [
            operator.volume,
            tiles.offsets.astype(np.int32),
            tiles.g,
            tiles.bits,
            tiles.general,
            tiles.D,
            lattice.total,
            operator.outside,
            *_listed(operator.change, nodes),
        ]
        session.expect_countable(sites.size)
        session.room_for(*(item.nbytes for item in fixed), 8 * sites.size, *6 * [8 * nodes], 4 * nodes)
        session.room_for(*(16 * len(item.node) + 4 * nodes + 4 for item in (drive.loads, drive.holds)))
        defined = {"SLOTS": len(tiles.offsets), "MARGIN": tiles.margin}
        names = {"OPEN": bool(operator.outside.any()), "LOADS": len(drive.loads.node) > 0, "VARIES": drive.varies}
        defined |= {name: 1 for name, enabled in names.items() if enabled}
        lines = [preamble("float64", 1), _law(operator.medium.C_sat)]
        lines += [f"#define {name} {value}" for name, value in defined.items()]
        program = session.build("\n".join([*lines, text_of("fick.cl")]))
        self._put, self._advance = program.put, program.advance
        self._site, self._fixed = session.put(sites.site), [session.put(item) for item in fixed]
        self._potential, self._amount = session.put(np.zeros(nodes)), session.zeros(8 * sites.size)
        self._h, self._rate, self._dissipated, self._work = (session.put(np.zeros(nodes)) for _ in range(4))
        self._source = session.put(np.ascontiguousarray(drive.force[:, 0]))
        self._acting = [*_entries(drive.loads, nodes, session), *_entries(drive.holds, nodes, session)]
        self._factors = Factors(session, drive.profiles, dt, ((-1, 0.0), (0, 0.0)))

    def advance(self, state: State, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1. Raises DeviceLostError."""
        if end_step <= first_step:
            return
        if not self._ahead:
            for buffer, values in self._mirrored():
                self.session.write(buffer, values)
        self._ahead, self._last = True, end_step - 1
        sizes, nodes = (self._size, LANES), np.int32(self._nodes)
        volume, *rest = self._fixed
        for step in range(first_step, end_step):
            at = (step - first_step) % AT_ONCE
            if at == 0:
                self._factors.write(step, min(AT_ONCE, end_step - step))
            arguments = self._site, volume, self._h, self._potential, self._amount, nodes
            self.session.launch(self._put, sizes, arguments)
            motion = self._h, self._rate, self._dissipated, self._work, self._source
            numbers = np.int32(self._factors.count), np.int32(at), np.float64(self._dt), nodes
            bonds = self._site, volume, self._potential, self._amount, *rest
            self.session.launch(self._advance, sizes, [*bonds, *motion, *self._acting, self._factors.buffer, *numbers])
        self.session.finish()

    def download_state(self) -> None:
        """Bring the state on the host up to the device's. Raises DeviceLostError."""
        if not self._ahead:
            return
        for buffer, values in self._mirrored():
            fresh = np.empty(len(values))
            self.session.read(buffer, fresh)
            values[:] = fresh
        if self._drive.varies:
            put_loads(self._drive, (self._last - 1) * self._dt)
        self._ahead = False

    def _mirrored(self) -> list[tuple[Any, NDArray[np.float64]]]:
        """Buffers, and the arrays of the state that they are."""
        state = self._state
        motion = (self._h, state.value[:, 0]), (self._rate, state.rate[:, 0])
        return [*motion, (self._dissipated, state.dissipated), (self._work, state.work)]


def _law(C_sat: float | None) -> str:
    """Fick's law in OpenCL C, of potentials up to C_sat, mol/m^3, if there is one."""
    written = Translation({})
    share, least = (written.called(function, (DOUBLE, DOUBLE))[0] for function in (share_of, saturated))
    potential = "h" if C_sat is None else f"{least}(h, {float(C_sat).hex()})"
    return f"{written.source}\n#define SHARE_OF {share}\n#define POTENTIAL(h) {potential}"


def _listed(bonds: BondList | None, nodes: int) -> list[NDArray[Any]]:
    """Starts, neighbours and conductances of changed bonds, and all that leaves nodes; none without any."""
    if bonds is None or not len(bonds.conductance):
        return [np.zeros(nodes + 1, dtype=np.int64), np.zeros(1, dtype=np.int32), np.zeros(1), np.zeros(nodes)]
    return [bonds.links.start, bonds.links.neighbour, bonds.conductance, bonds.total]


def _entries(entries: Entries, nodes: int, session: Session) -> list[Any]:
    """Entries by nodes on the device, those of a node in their order: first of each node, values, profiles."""
    order = np.argsort(entries.node, kind="stable")
    first = np.searchsorted(entries.node[order], np.arange(nodes + 1)).astype(np.int32)
    columns = first, entries.value[order].astype(np.float64), entries.profile[order].astype(np.int32)
    return [session.put(column) for column in columns]
