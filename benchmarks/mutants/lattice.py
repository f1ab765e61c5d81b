"""Lines of the march of bodies, each broken by hand."""

from __future__ import annotations

from benchmarks.mutants.mutant import UNIT, Mutant

MARCH = "pdsolve/steppers/verlet_tiles.py"
VERLET = f"{UNIT}/test_verlet_tiles.py::test_each_bit_is_that_of_verlet_on_any_number_of_threads"
LATTICE = tuple(
    Mutant(MARCH, line, becomes, VERLET)
    for line, becomes in (
        ("    tile_motion.next_v_has_failure_forces[tile] = False\n", ""),
        ("select_breaks(new, np.lexsort((new.places[:, 0] // ROW, new.bonds[:, 0])))", "select_breaks(new, slice(-1))"),
        ("join_breaks(breaks + self._collect_and_clear_new_breaks())", "self._collect_and_clear_new_breaks()[0]"),
        ("        pull_again(tiles, motion, failure_force, breaks, n)\n", "        pass\n"),
        ("v = advanced(advanced(v, a, half), a, half)", "v = advanced(v, a, dt)"),
        ("(drive.before[i, axis] + drive.force[i, axis]) / 2", "drive.force[i, axis]"),
        ("if c > 0 and not tile_motion.constrained[i, axis]", "if c > 0"),
        ("tile_motion.v_buffers[after][axis, site]", "tile_motion.v_buffers[0][axis, site]"),
    )
)
