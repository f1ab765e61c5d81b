"""What leaving work out could save: blocks the first wave has not reached, longer steps where nodes are coarse.

`python -m benchmarks.savings` prints it for two scenes. Neither is built into the solver; benchmarks/README.md says
why. The strip of the wave test, and its bonds as a matrix, are those of tests/verification.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.claims import Case
from benchmarks.runs import built
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import Prepared

BLOCK = 64  # nodes
SCENES = ("kalthoff_winkler.geo", "figure_19.py")


def quiet_share(problem: Prepared) -> float:
    """Share of the bond sums of a whole run that sum nothing but zeros: their block and its neighbours are at rest."""
    system, state = problem
    count, steps = -(-len(system.count) // BLOCK), system.model.settings.run.steps
    source, target = (rows // BLOCK for rows in system.operator.bonds())
    pairs, bonds, share = np.unique(source * count + target), np.bincount(source, minlength=count), 0.0
    loaded = np.bincount(system.drive.loads.node // BLOCK, minlength=count) > 0
    for step in range(1, steps + 1):
        moving = ((state.value != 0) | (state.rate != 0) | (state.second != 0)).any(axis=1)
        moves = loaded | (np.bincount(np.flatnonzero(moving) // BLOCK, minlength=count) > 0)
        awake = moves | (np.bincount(pairs // count, moves[pairs % count], minlength=count) > 0)
        if awake.all():
            break
        share += float(bonds[~awake].sum() / system.bonds) / steps
        problem.march(step, step + 1)
    return share


def coarse_share(problem: Prepared) -> float:
    """Share of all bond sums left out if nodes far from others' spacings stepped as seldom as theirs allows."""
    delta, (source, target) = problem.system.model.grid.delta, problem.system.operator.bonds()
    alone = np.bincount(source, delta[target] != delta[source], minlength=len(delta)) == 0
    seldom = np.where(alone, np.floor(delta / delta.min() * (1 + 1e-9)), 1.0)
    return 1 - float(np.sum(problem.system.count / seldom) / problem.system.bonds)


class Halved:
    """Verlet with every second step left out for the coarse nodes, whose displacement the fine ones interpolate."""

    def __init__(self, K: NDArray[np.float64], u: NDArray[np.float64], v: NDArray[np.float64], coarse: object) -> None:
        self.K, self.u, self.v, self.coarse = K, u.copy(), v.copy(), coarse

    def take(self, dt: float) -> None:
        """Two steps of the fine nodes, one of the coarse ones."""
        c, u, v, K = self.coarse, self.u, self.v, self.K
        v[c] -= dt * (K @ u)[c]
        start, end = u[c].copy(), u[c] + 2 * dt * v[c]
        for half in (0.5, 1.0):
            v[~c] -= dt / 2 * (K @ u)[~c]
            u[~c] += dt * v[~c]
            u[c] = start + half * (end - start)
            v[~c] -= dt / 2 * (K @ u)[~c]
        v[c] -= dt * (K @ u)[c]


def wave_test(width: float, share: float) -> dict[str, tuple[float, float]]:
    """What comes back of a pulse, and the largest change of energy over its energy, for plain and for halved steps."""
    sys.path.append(str(Path(__file__).parent.parent / "tests"))
    sys.path.append(str(Path(__file__).parent.parent / "tests" / "verification"))
    from plates import GLASS
    from systems import matrix, weighted
    from test_interface_waves import REACH, SPEED, strip

    problem = strip("conservative", max(12 * width, 0.06))
    x, delta = problem.system.model.grid.position[:, 0], problem.system.model.grid.delta
    start, dt = -max(5 * width, 5 * REACH), share * problem.system.bound
    K, A = matrix(problem) / GLASS.rho, weighted(problem)
    mass = np.repeat(GLASS.rho * problem.system.area, 2)
    s = (x - start) / width
    u, v = np.zeros((2, len(x), 2))
    u[:, 0], v[:, 0] = 1e-6 * np.exp(-(s**2)), 1e-6 * SPEED * 2 * s / width * np.exp(-(s**2))
    found = {}
    for name, coarse in (("plain", np.zeros(len(x), dtype=bool)), ("halved", delta > delta.min())):
        run = Halved(K, u.ravel(), v.ravel(), np.repeat(coarse, 2))
        first, worst = 0.0, 0.0
        for step in range(round(-2 * start / SPEED / dt / 2)):
            energy = float(run.v @ (mass * run.v) + run.u @ (A @ run.u)) / 2
            first = energy if step == 0 else first
            worst = max(worst, abs(energy / first - 1))
            run.take(dt)
        back = np.abs(run.v[::2][x < -1.5 * REACH]).max() / np.abs(v).max()
        found[name] = (float(back), worst)
    return found


def main() -> None:
    """Print all of it."""
    with tempfile.TemporaryDirectory() as folder:
        for scene in SCENES:
            model = built(Case(Path(scene).stem, "", scene, ()), Path(folder))
            problem = prepare(model, Options())
            spacings, counts = np.unique(model.grid.delta, return_counts=True)
            nodes = ", ".join(f"{n} of {1e3 * d:g} mm" for d, n in zip(spacings, counts, strict=True))
            print(f"{scene}: {nodes}")
            print(f"  larger steps for coarse nodes leave out at most {coarse_share(problem):.1%} of the bond sums")
            print(f"  skipping blocks at rest leaves out {quiet_share(problem):.2%} of the bond sums of the run")
    for width in (4e-3, 8e-3, 16e-3):
        for share in (0.5, 0.8):
            rows = wave_test(width, share)
            told = "; ".join(f"{name}: sent back {back:.4f}, energy {off:.1e}" for name, (back, off) in rows.items())
            print(f"pulse of {1e3 * width:g} mm at {share:g} of the bound: {told}")


if __name__ == "__main__":
    main()
