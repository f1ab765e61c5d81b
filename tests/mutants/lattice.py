"""Lines of the march of plates and bodies, each broken by hand."""

from __future__ import annotations

from mutants.mutant import UNIT, Mutant

MARCH, BONDS = "pdsolve/lattice/march.py", "pdsolve/lattice/marched_bonds.py"
BOND = "pdsolve/lattice/bond.py"
VERLET = f"{UNIT}/test_lattice_march.py::test_each_bit_is_that_of_verlet_on_any_number_of_threads"
LATTICE = tuple(
    Mutant(file, line, becomes, VERLET)
    for file, line, becomes in (
        (BONDS, "        has_failure_forces[group] = False\n", ""),
        (BONDS, "np.lexsort((new.places[:, 0] // ROW, new.bonds[:, 0]))", "slice(-1)"),
        (
            BONDS,
            "        self._collect_and_clear_breaks()\n        self._operator.extend",
            "        self._operator.extend",
        ),
        (BONDS, "        pull_again(bonds, motion, history, n)\n", "        pass\n"),
        (BONDS, "self._collect(state, sweep - 1, sweep)", "self._collect(state, sweep - 1, 0)"),
        (BOND, "advanced(advanced(beside(v, axes, at), a, half), a, half)", "beside(v, axes, at)"),
        (MARCH, "(drive.before[i, axis] + drive.force[i, axis]) / 2", "drive.force[i, axis]"),
        (MARCH, "np.where(constrained_components(drive), 0.0, damping[:, None])", "np.tile(damping[:, None], 3)"),
    )
)
