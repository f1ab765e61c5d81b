"""Families of nodes on a lattice on a device: two passes of a state-based law.

Where bonds may fail in a step, the processor looks at the nodes that the device names, and breaks them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.device.nodes import NodesOnDevice
from pdsolve.device.runtime import Session
from pdsolve.device.source import text_of
from pdsolve.device.tracing import Code
from pdsolve.lattice.families import SAFE
from pdsolve.lattice.family_blocks import FamilyBlocks
from pdsolve.lattice.family_operator import FamilyLattice
from pdsolve.lattice.layout import LANES
from pdsolve.laws.bond_arrays import Bond, Now, Tabled
from pdsolve.laws.calls import functions_of
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.operators import bond_list_loops as loops
from pdsolve.state import State


class FamiliesOnDevice(NodesOnDevice, FamilyLattice):
    """The families of n nodes whose steps a device takes; see `pdsolve.steppers.verlet_on_device`."""

    layout: FamilyBlocks

    def __init__(
        self,
        law: Law,
        model: Model,
        exact: Bonds,
        symmetric: bool,
        precision: str,
        make_layout: Callable[[Tabled, np.dtype[Any]], FamilyBlocks],
        session: Session,
    ) -> None:
        """Arguments are those of `FamilyLattice`. Raises ModelError if the device has too little memory."""
        super().__init__(law, model, exact, symmetric, precision, 1, make_layout)
        self.dimension, self.room = self._u.shape
        self.place, self._fresh = slice(0, len(model.grid)), [np.zeros(0, dtype=np.int64)]
        bonds = self.layout.bonds
        arrays: dict[str, NDArray[Any]] = {
            "start": bonds.start.astype(np.int32),
            "slots": bonds.slots,
            "ids": bonds.ids,
        }
        arrays |= {"vectors": bonds.vectors, "kinds": bonds.kinds, "rows": bonds.rows, "own": self._own}
        arrays |= {"nodal": self._m, "given": np.zeros((self.dimension, self.room)), "flags": np.zeros(2, np.int32)}
        arrays |= {"near": np.zeros(self.room, np.uint8), "dissipated": np.zeros(self.room)}
        self.upload(session, arrays)

    def source(self) -> str:
        """What the bonds are in OpenCL C. Raises ModelError for a law that no device computes to the same bits."""
        said, law, code, numbers = functions_of(self.law), self.columns, Code(), self._tabled.nodal_count
        count = len(said["initial_sums"](law, (0.0,) * self.dimension, 0.0))  # of the first pass
        sums, constants = code.named("s[{}]", count), code.named("own[{} * m + i]", len(self._own))
        xi, eta = code.named("bond.xi[{}]", self.dimension), code.named("bond.eta[{}]", self.dimension)
        rest = (code.named(f"bond.{name}", 1)[0] for name in ("length", "q", "stretch", "elongation", "inverse"))
        bond = Bond(xi, eta, *rest), code.named("c[{}]", len(self._tabled.columns))
        ends = code.named("nodal[{} * m + i]", numbers), code.named("nodal[{} * m + j]", numbers)
        called: dict[
            str, tuple[str, tuple[Any, ...], str]
        ] = {  # macro, function, arguments, and what is done with each
            "ACCUMULATE": ("accumulate", (*bond, sums), "s[{0}] = {1};"),
            "FINISH": ("finish_sums", (sums, constants), "nodal[{0} * m + i] = {1};"),
            "BOND_FORCE": ("bond_force", (*bond, *ends), "f[{0}] = f[{0}] + {1};"),
        }
        defined = {
            "C": len(bond[1]),
            "FIELDS": self.layout.bonds.vectors.shape[1],
            "SUMS": count,
            "WIDTH": len(self._m),
        }
        defined["MARGIN"] = ""
        for name, (function, arguments, form) in called.items():
            outputs = code.call(said[function], law, *arguments)
            last = [form.format(k, output.text) for k, output in enumerate(outputs)]
            defined[name] = " ".join(code.lines + last)
        if self._tabled.watched:
            value, limit = code.call(said["margin"], law, *bond, *ends)
            most = limit * (1.0 - SAFE)
            last = [f"if ({value.text} > {most.text}) flags[1] = near[i] = 1;"]
            defined["MARGIN"] = " ".join(code.lines + last)
        lines = [f"#define {name} {value}" for name, value in defined.items()]
        return "\n".join([self.declarations, *lines, text_of("families.cl")])

    def take_passes(self, program: Any) -> None:
        """Keep the kernels of the passes."""
        self._first_pass, self._watch, self._last_pass = program.first_pass, program.watch, program.bond_forces

    def may_change(self, u: Any, step: int) -> bool:
        """Sum the first pass at these displacements of the device; whether a bond may fail or pulls once more."""
        self._launch(self._first_pass, u)
        flags = np.zeros(2, dtype=np.int32)
        if self._tabled.watched:
            self.write("flags", flags)
            self._launch(self._watch, u)
            self.read("flags", flags)
        return bool(flags[1]) or self._torn_in == step - 1

    def fail(self, u: Any, state: State, step: int, dt: float) -> None:
        """Let the bonds that are over their limit fail; `state` is that of the device, with these displacements u."""
        nodes = len(state.value)
        now, near, torn = Now(state.value, state.rate, step, dt), np.zeros(self.room, np.uint8), np.zeros(nodes, bool)
        self.read("near", near)
        self.read("nodal", self._m)
        between = self._m[:, :nodes].T
        self._share(loops.fail_rows, now, between, near[:nodes] > 0, self._failing, torn)
        again = np.zeros(state.value.shape)
        self._pull_again(now, again)
        if not torn.any():
            if again.any():
                self._write_forces(self._bond_forces(u, nodes) + again)
            return
        before, rows, released = self._bond_forces(u, nodes), np.flatnonzero(torn), np.zeros(nodes)
        matched, spent = self._match_work(now, between, rows)
        self._fail(now, between, rows, released)
        self._write_torn()
        self.write("nodal", self._m)
        pulls = self._bond_forces(u, nodes)
        self._book(state, dt, before - pulls, matched, released, spent)
        self._write_forces(again + (pulls + matched))
        self.write("dissipated", self.spread(state.dissipated))

    def _write_forces(self, forces: NDArray[np.float64]) -> None:
        """Give the device the forces (n, d) of this step."""
        self.write("given", self.spread(forces))
        self.write("flags", np.array([1, 0], dtype=np.int32))

    def _bond_forces(self, u: Any, nodes: int) -> NDArray[np.float64]:
        """Force densities (n, d), N/m^3, from what nodes have between the passes; the next step has them."""
        self._launch(self._last_pass, u)
        return self.read("given", np.empty((self.dimension, self.room)))[:, :nodes].T

    def _launch(self, kernel: Any, u: Any) -> None:
        self.session.launch(kernel, (self.room, LANES), [*self.buffers.values(), u, np.int32(self.room)])

    def _lose(self, bonds: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        super()._lose(bonds, rows)
        self._fresh.append(np.unique(self.layout.lane_of[bonds] // LANES))

    def _write_torn(self) -> None:
        """Give the slots of which a bond has broken to the device."""
        torn, rows = np.unique(np.concatenate(self._fresh)), self.layout.bonds.rows
        self._fresh = self._fresh[:1]
        if len(torn):
            self.write("slots", self.layout.bonds.slots)
            self.write("own", self._own)
        for row in (self.layout.shared_rows + torn).tolist():
            self.write("rows", rows[row], row * rows[row].nbytes)

    def hand_over(self) -> None:
        """Give the history of bonds to the device, if it is another than the device's."""
        if self.needs_upload:
            self.write("slots", self.layout.bonds.slots)
            self._write_torn()
            self.needs_upload = False

    def fetch(self, step: int) -> None:
        """Nothing: what bonds remember is the processor's."""
