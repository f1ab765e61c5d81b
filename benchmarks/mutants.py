"""Whether tests notice when the code is wrong: one line is broken at a time, in a copy, and some test has to fail.

`make mutants`, or `python -m benchmarks.mutants [WORD ...]` for those whose file or line has a word in it. Returns 1
where a mutant survives, where its line is not there any more, or where a test fails without it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
COPIED = ("pdmesh", "pdsolve", "pdpost", "tests", "geometries", "benchmarks", "docs")
UNIT, CONTRACTS = "tests/unit/pdsolve", "tests/contracts/test_laws.py"


class Mutant(NamedTuple):
    """A line of the packages, what it becomes, and tests of which one has to fail then."""

    file: str
    line: str  # part of it, there once
    becomes: str
    tests: str  # for pytest, separated by blanks


MUTANTS = (
    Mutant(
        "pdsolve/steppers/holds.py",
        "v[i, axis] = holds.value[e] * factor_at(profiles, holds.profile[e], time - dt / 2)",
        "v[i, axis] = holds.value[e] * factor_at(profiles, holds.profile[e], time)",
        f"{UNIT}/test_conditions.py::test_a_held_velocity_follows_its_profile",
    ),
    Mutant(
        "pdsolve/steppers/holds.py",
        "value = holds.value[e] * factor_at(profiles, holds.profile[e], time)",
        "value = holds.value[e] * factor_at(profiles, holds.profile[e], time - dt / 2)",
        f"{UNIT}/test_conditions.py::test_a_held_velocity_follows_its_profile",
    ),
    Mutant(
        "pdsolve/measures.py",
        "whole = sound[source] & sound[target]",
        "whole = sound[source] | sound[target]",
        f"{UNIT}/test_simulation.py::test_pieces_are_not_joined_by_cracked_nodes",
    ),
    Mutant(  # resumed
        "pdsolve/operators/blocks/layout.py",
        "stiffness[soft] = _intact_share(*(column.astype(np.float64) for column in columns)) * stiffness[soft]",
        "stiffness[soft] = stiffness[soft]",
        f"{UNIT}/test_blocks.py::test_bonds_that_have_softened_stay_so_when_they_are_let_go",
    ),
    Mutant(  # let go
        "pdsolve/operators/blocks/kernel.py",
        "blocks.softened[b] = True",
        "blocks.softened[b] = False",
        f"{UNIT}/test_blocks.py::test_bonds_that_have_softened_stay_so_when_they_are_let_go",
    ),
    Mutant(
        "pdsolve/results/schema.py",
        '    "bond_break",\n    "history",',
        '    "history",',
        f"{UNIT}/test_interrupted_runs.py::test_what_a_killed_run_wrote_after_its_checkpoint_is_dropped",
    ),
    Mutant(
        "pdsolve/results/writer.py",
        'later |= {"node": f"birth > {step}", ',
        'later |= {"node": f"birth > {step + 1}", ',
        "tests/formats/test_epochs.py::test_what_was_born_and_died_after_the_checkpoint_is_dropped",
    ),
    Mutant(
        "pdsolve/results/lives.py",
        "return np.flatnonzero((self.birth <= step) & (step < self.death))",
        "return np.flatnonzero((self.birth <= step) & (step <= self.death))",
        "tests/formats/test_epochs.py::test_each_frame_has_the_nodes_there_were",
    ),
    Mutant(
        "pdsolve/results/schema.py",
        "(d.step IS NULL OR d.step > f.step)",
        "(d.step IS NULL OR d.step >= f.step - 3)",
        "tests/formats/test_epochs.py::test_sql_sees_the_nodes_of_each_frame",
    ),
    Mutant(
        "pdpost/measures/cracked.py",
        "np.minimum.at(since, one[cracked], since[other[cracked]])",
        "since[one[cracked]] = birth[one[cracked]]",
        "tests/unit/pdpost/measures/test_changing.py::test_a_node_that_is_born_cracked_is_so_since_the_one_before",
    ),
    Mutant(
        "pdpost/measures/tips.py",
        "np.arctan2(came[0] * w[1] - came[1] * w[0], came @ w)",
        "np.arctan2(came[1] * w[0] - came[0] * w[1], came @ w)",
        "tests/unit/pdpost/measures/test_tips.py::test_arms_to_the_left_are_positive",
    ),
    Mutant(
        "pdpost/measures/tradeoff.py",
        "return float(np.sqrt(np.sum(area * off**2) / size))",
        "return float(np.sqrt(np.sum(area.mean() * off**2) / size))",
        "tests/unit/pdpost/measures/test_tradeoff.py::test_large_cells_weigh_more",
    ),
    Mutant(
        "pdsolve/adaptive/split/motion.py",
        "split, merged = (heirs.away, heirs.apart, heirs.apart)",
        "split, merged = (heirs.away, heirs.away, heirs.away)",
        "tests/unit/pdsolve/test_split.py::test_cells_that_an_edge_cuts_keep_their_area",
    ),
    Mutant(
        "pdsolve/adaptive/split/cracks.py",
        "(ways > 0).sum(axis=1) == 1",
        "(ways > 0).sum(axis=1) == 3",
        "tests/unit/pdsolve/test_split.py::test_no_bond_heals",
    ),
    Mutant(
        "pdsolve/schemes/average_horizon.py",
        "intact = (far < 2 * self._farthest) & self._strong(modulus, reach)",
        "intact = self._strong(modulus, reach)",
        f"{UNIT}/test_average_horizon.py",
    ),
    Mutant(
        "pdsolve/schemes/average_horizon.py",
        "(own[pairs.source] + own[pairs.target])",
        "(lack[pairs.source, first + 1 - axis] + lack[pairs.target, first + 1 - axis])",
        f"{UNIT}/test_average_horizon.py",
    ),
    Mutant(
        "pdsolve/laws/brittle.py",
        "return law.stiffness[k] * bond.length / 4 * bond.stretch * bond.stretch, 0.0",
        "return law.stiffness[k] * bond.length / 2 * bond.stretch * bond.stretch, 0.0",
        f"{CONTRACTS}::test_force_is_minus_the_slope_of_energy",
    ),
    Mutant(
        "pdsolve/laws/bilinear.py",
        "force *= intact_share(law.worst[k], law.peak[k], law.limit[k])",
        "force *= intact_share(law.peak[k], law.peak[k], law.limit[k])",
        f"{CONTRACTS}::test_force_is_minus_the_slope_of_energy",
    ),
    Mutant(
        "pdsolve/laws/ordinary.py",
        "return along(force, bond.xi, bond.eta)",
        "return along(force, bond.xi, bond.xi)",
        f"{CONTRACTS}::test_momentum_and_angular_momentum",
    ),
    Mutant(
        "pdsolve/laws/lists.py",
        "return Bond(xi, eta, length, q, e / (q + 1), more * now * once, reach * once)",
        "return Bond(xi, eta, length, q, along / squared, along / length, reach * once)",
        f"{CONTRACTS}::test_a_rigid_motion_makes_no_force_and_holds_no_energy",
    ),
    Mutant(
        "pdsolve/laws/ordinary.py",
        "    return own + other\n",
        "    return 2 * own\n",
        f"{CONTRACTS}::test_momentum_and_angular_momentum",
    ),
    Mutant(
        "pdsolve/operators/rows.py",
        "        m[i] = 0\n",
        "        m[i] = m[max(i - 1, first)] / 2\n",
        f"{CONTRACTS}::test_uniform_strain_makes_no_force_inside",
    ),
    Mutant(
        "pdsolve/operators/rows.py",
        "m[i] = 0\n        for k in range(bonds.start[i], bonds.start[i + 1])",
        "m[i] = 0\n        for k in range(bonds.start[i], bonds.start[i + 1] - 1)",
        f"{CONTRACTS}::test_a_mirror_image_has_mirrored_forces",
    ),
    Mutant(
        "pdsolve/laws/lists.py",
        "tuple(np.ascontiguousarray(x) for x in bonds.xi.T)",
        "tuple(np.sort(x) for x in bonds.xi.T)",
        f"{CONTRACTS}::test_numbering_does_not_matter",
    ),
    Mutant(
        "pdsolve/operators/listed.py",
        "                column[:] = 0\n",
        "",
        f"{CONTRACTS}::test_what_was_kept_goes_on_to_the_same_bits",
    ),
    Mutant(
        "pdsolve/operators/listed.py",
        "which = np.flatnonzero(column)",
        "which = np.flatnonzero(column)[1:]",
        f"{CONTRACTS}::test_what_was_kept_goes_on_to_the_same_bits",
    ),
    Mutant(
        "pdsolve/operators/listed.py",
        "share(lambda first, last: loop(self._list, self.columns, *arrays, first, last)",
        "share(lambda first, last: loop(self._list, self.columns, *arrays, max(first - 1, 0), last)",
        f"{CONTRACTS}::test_one_thread_and_two_give_the_same_bits",
    ),
    Mutant(
        "pdsolve/operators/tangent.py",
        "_slope(bonds, law, now, m, step, i, j, k, j, a, f, other)",
        "_slope(bonds, law, now, m, step, i, j, k, i, a, f, other)",
        f"{CONTRACTS}::test_the_tangent_is_minus_the_slope_of_the_force",
    ),
    Mutant(
        "pdsolve/bonds.py",
        "return (sums[0, 0] + sums[1, 1]) / 2 + np.hypot(",
        "return (sums[0, 0] + sums[1, 1]) / 2 - np.hypot(",
        "tests/verification/test_time_step.py::test_the_bound_is_safe_whatever_pre_cracks_cut",
    ),
    Mutant(
        "pdsolve/operators/bound.py",
        "(SAFE * largest / 2)",
        "(SAFE * largest / 4)",
        f"{CONTRACTS}::test_the_bound_is_safe_and_not_far_off",
    ),
    Mutant(
        "pdsolve/operators/rows.py",
        "@njit(**KERNEL)\ndef energy_rows",
        "@njit(nogil=True)\ndef energy_rows",
        "tests/contracts/test_compiled.py",
    ),
    Mutant(
        "pdsolve/laws/lists.py",
        "x = bond.xi[a] + now.value[j, a] - now.value[i, a] - now.dt * (",
        "x = bond.xi[a] + now.value[j, a] - now.value[i, a] - 0 * (",
        f"{UNIT}/test_kernels.py::test_a_breaking_bond_takes_its_energy_along",
    ),
    Mutant(
        "pdsolve/steppers/verlet.py",
        "work[i] += (before[i, axis] + load[i, axis]) / 2 * (dt * v[i, axis])",
        "work[i] += load[i, axis] * (dt * v[i, axis])",
        f"{UNIT}/test_blocks.py::test_a_whole_run",
    ),
    Mutant(
        "pdsolve/notes.py",
        "    put_loads(system.drive, step * system.time_step)\n",
        "",
        f"{UNIT}/test_interrupted_runs.py::test_interrupted_anywhere",
    ),
    Mutant(
        "pdsolve/laws/__init__.py",
        "return bilinear if others else first",
        "return first",
        "tests/laws/test_table.py",
    ),
)


def passes(tree: Path, tests: str) -> bool:
    """Whether all of these tests of a tree do."""
    words = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests.split()]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    ran = subprocess.run(words, cwd=tree, capture_output=True, text=True, env=environment)
    if ran.returncode not in (0, 1):
        raise SystemExit(f"{tests}: these tests could not be run\n{ran.stdout[-2000:]}{ran.stderr[-2000:]}")
    return ran.returncode == 0


def fate(tree: Path, mutant: Mutant) -> str:
    """What became of a mutant."""
    path = tree / mutant.file
    text = path.read_text()
    if text.count(mutant.line) != 1:
        return f"STALE: its line is there {text.count(mutant.line)} times, expected once"
    path.write_text(text.replace(mutant.line, mutant.becomes))
    try:
        return "SURVIVED" if passes(tree, mutant.tests) else "killed"
    finally:
        path.write_text(text)


def main(words: list[str]) -> int:
    """Break, test, mend; returns the exit code."""
    chosen = [one for one in MUTANTS if not words or any(word in one.file + one.line for word in words)]
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for name in COPIED:
            shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("pyproject.toml", "README.md"):
            shutil.copy(ROOT / name, tree)
        every = " ".join(dict.fromkeys(one.tests for one in chosen))
        if not passes(tree, every):
            raise SystemExit("some of the tests fail without a mutant")
        alive = 0
        for one in chosen:
            began = time.perf_counter()
            found = fate(tree, one)
            alive += found != "killed"
            print(
                f"{found}, {time.perf_counter() - began:.0f} s: {one.file}: {one.becomes.strip() or one.line.strip()}"
            )
            sys.stdout.flush()
    print(f"{len(chosen)} mutants, {alive} alive")
    return int(alive > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
