"""Families of nodes on lattices on a device: two passes of a state-based law, or fluxes in one.

Where bonds may fail in a step, the processor looks at the nodes that the device names, and breaks them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.device.nodes import NodesOnDevice
from pdsolve.device.runtime import Session
from pdsolve.device.source import text_of
from pdsolve.device.tracing import Code, Traced
from pdsolve.lattice.families import SAFE, FamilySlots, FamilyTiles
from pdsolve.lattice.family_blocks import FamiliesInBlocks
from pdsolve.lattice.family_operator import FamilyLattice
from pdsolve.lattice.family_tiles import FamiliesInTiles
from pdsolve.lattice.flux_operator import Array, FluxesInList, FluxesInTiles
from pdsolve.lattice.fluxes import FluxTiles, share_of
from pdsolve.lattice.layout import LANES
from pdsolve.laws.bond_arrays import Bond, Ends, Now
from pdsolve.laws.calls import initial_sums
from pdsolve.laws.fluxes import Conduction
from pdsolve.operators import bond_list_loops as loops
from pdsolve.state import State

Layout = FamilySlots | FamilyTiles | FluxTiles


class FamiliesOnDevice(NodesOnDevice, FamilyLattice):
    """The families of n nodes whose steps a device takes; see `pdsolve.device.nodes`."""

    layout: FamiliesInBlocks | FamiliesInTiles

    def put_on(self, session: Session) -> None:
        """Put the bonds on a device, which takes the steps from here on. Raises ModelError if it has too little
        memory."""
        self.dimension, self.room = self._u.shape
        self.place, self._fresh = self.layout.places(self._every), [np.zeros(0, dtype=np.int64)]
        arrays = {**arrays_of(self.layout.bonds), "own": self._own, "nodal": self._m}
        arrays |= {"given": np.zeros((self.dimension, self.room)), "flags": np.zeros(2, np.int32)}
        arrays |= {"near": np.zeros(self.room, np.uint8), "dissipated": np.zeros(self.room)}
        if isinstance(self.layout, FamiliesInTiles):
            arrays["node"] = self.spread(self._every.astype(np.int32), -1)
        self.upload(session, arrays)

    def source(self) -> str:
        """What the bonds are in OpenCL C. Raises ModelError for a law that no device computes to the same bits."""
        law, code, numbers = self.columns, Code(), self._tabled.nodal_count
        xi, eta = code.named("bond.xi[{}]", self.dimension), code.named("bond.eta[{}]", self.dimension)
        rest = (code.named(f"bond.{name}", 1)[0] for name in ("length", "q", "stretch", "elongation", "inverse"))
        bond, c = Bond(xi, eta, *rest), code.named("c[{}]", len(self._tabled.columns))
        ends = code.named("nodal[{} * m + i]", numbers), code.named("nodal[{} * m + j]", numbers)
        defined = first_pass_of(law, code, bond, len(c), code.named("own[{} * m + i]", len(self._own)))
        forces = code.call("bond_force", law, bond, c, *ends)
        defined |= {"BOND_FORCE": code.statements("f[{0}] = f[{0}] + {1};", forces), "MARGIN": ""}
        defined |= {"FIELDS": self.layout.bonds.vectors.shape[1], "WIDTH": len(self._m)}
        if self._tabled.watched:
            value, limit = code.call("margin", law, bond, c, *ends)
            over = f"if ({value.text} > {{1}}) flags[1] = near[i] = 1;"
            defined["MARGIN"] = code.statements(over, (limit * (1.0 - SAFE),))
        return self.declarations + "\n" + family_source(self.layout.bonds, defined)

    def take_kernels(self, program: Any) -> None:
        """Keep the kernels of the passes."""
        self._first_pass, self._watch, self._last_pass = program.first_pass, program.watch, program.bond_forces

    def needs_host(self, u: Any, step: int) -> bool:
        """Sum the first pass at these displacements of the device; whether a bond may fail or pulls once more."""
        self._launch(self._first_pass, u)
        flags = np.zeros(2, dtype=np.int32)
        if self._tabled.watched:
            self.write("flags", flags)
            self._launch(self._watch, u)
            self.read("flags", flags)
        return bool(flags[1]) or self._torn_in == step - 1

    def break_bonds_on_host(self, u: Any, state: State, step: int, dt: float) -> None:
        """Let the bonds that are over their limit fail; `state` is that of the device, with these displacements u."""
        nodes = len(state.value)
        now, torn = Now(state.value, state.rate, step, dt), np.zeros(nodes, bool)
        near = self.read("near", np.zeros(self.room, np.uint8))[self.place]
        between = self.layout.collect(self.read("nodal", self._m))
        self._share(loops.fail_rows, now, between, near > 0, self._failing, torn)
        again = np.zeros(state.value.shape)
        self._pull_again(now, again)
        if not torn.any():
            if again.any():
                self._write_forces(self._bond_forces(u) + again)
            return
        before, rows, released = self._bond_forces(u), np.flatnonzero(torn), np.zeros(nodes)
        matched, spent = self._match_work(now, between, rows)
        self._fail(now, between, rows, released)
        self._write_torn()
        self.layout.place(between, self._m)
        self.write("nodal", self._m)
        pulls = self._bond_forces(u)
        self._book(state, dt, before - pulls, matched, released, spent)
        self._write_forces(again + (pulls + matched))
        self.write("dissipated", self.spread(state.dissipated))

    def _write_forces(self, forces: NDArray[np.float64]) -> None:
        """Give the device the forces (n, d) of this step."""
        self.write("given", self.spread(forces))
        self.write("flags", np.array([1, 0], dtype=np.int32))

    def _bond_forces(self, u: Any) -> NDArray[np.float64]:
        """Force densities (n, d), N/m^3, from what nodes have between the passes; the next step has them."""
        self._launch(self._last_pass, u)
        return self.read("given", np.empty((self.dimension, self.room)))[:, self.place].T

    def _launch(self, kernel: Any, u: Any) -> None:
        self.session.launch(kernel, (self.room, LANES), [*self.buffers.values(), u, np.int32(self.room)])

    def _lose(self, bonds: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        super()._lose(bonds, rows)
        if isinstance(self.layout, FamiliesInBlocks):
            self._fresh.append(np.unique(self.layout.lane_of[bonds] // LANES))

    def _write_torn(self) -> None:
        """Give what the loss of bonds has changed to the device: bits, or the rows of slots."""
        self.write("own", self._own)
        if isinstance(self.layout, FamiliesInTiles):
            self.write("bits", self.layout.bonds.bits)
            return
        self.write("slots", self.layout.bonds.slots)
        torn, rows = np.unique(np.concatenate(self._fresh)), self.layout.bonds.rows
        self._fresh = self._fresh[:1]
        for row in (self.layout.shared_rows + torn).tolist():
            self.write("rows", rows[row], row * rows[row].nbytes)

    def hand_over(self) -> None:
        """Give the history of bonds to the device, if it is another than the device's."""
        if self.needs_upload:
            self._write_torn()
            self.needs_upload = False


class FluxesOnDevice(NodesOnDevice):
    """The fluxes of n nodes whose steps a device takes; see `pdsolve.device.nodes`."""

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


def arrays_of(bonds: Layout) -> dict[str, NDArray[Any]]:
    """The arrays of a layout for a device, by name."""
    arrays = {name: array for name, array in bonds._asdict().items() if isinstance(array, np.ndarray)}
    return {name: array.view(np.uint8) if array.dtype == np.bool_ else array for name, array in arrays.items()}


def first_pass_of(law: Any, code: Code, bond: Bond | Ends, count: int, constants: tuple[Traced, ...]) -> dict[str, Any]:
    """Macros of the first pass of a law over bonds with so many numbers, and nodes with these constants."""
    sums = code.named("s[{}]", len(initial_sums(law, (0.0,) * len(getattr(bond, "xi", ())), 0.0)))
    accumulated = code.call("accumulate", law, bond, code.named("c[{}]", count), sums)
    defined = {"C": count, "SUMS": len(sums), "ACCUMULATE": code.statements("s[{0}] = {1};", accumulated)}
    finished = code.call("finish_sums", law, sums, constants)
    return defined | {"FINISH": code.statements("between[{0}] = {1};", finished)}


def family_source(bonds: Layout, defined: dict[str, Any]) -> str:
    """The OpenCL C of a layout, given the macros of a law."""
    numbers: dict[str, Any] = {
        f"OF_{name.upper()}": number for name, number in bonds._asdict().items() if isinstance(number, int)
    }
    if not isinstance(bonds, FamilySlots):
        numbers |= {"SITES": "", "SLOTS": len(bonds.offsets)}
    if isinstance(bonds, FamilyTiles):
        numbers["NUMBERS"] = f"{bonds.numbers.shape[1]}L"
    lines = [f"#define {name} {value}" for name, value in {**defined, **numbers}.items()]
    return "\n".join([*lines, text_of("families.cl")])
