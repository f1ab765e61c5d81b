"""A measured load-displacement curve in a CSV file, and the force of a run at its displacements.

The head of a column is its name, a comma and its unit, in quotation marks as it contains a comma: `"lift, mm"`. One
column has a unit of length, and one a unit of force or of force per thickness. A column `weight` without a unit is
optional; other columns are not read. Lines that begin with # are comments.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import FilePath, read_bytes
from pdmesh.quantities import UNITS, Unit
from pdsolve.measures.forces import (
    force_over_gap_opening,
    read_condition_force_histories,
    read_named_gap,
    select_condition_force_histories,
)
from pdsolve.results import Results

FORCES = {"N": Unit(1, 1), "kN": Unit(1000, 1), "MN": Unit(1_000_000, 1)}
FORCES_PER_THICKNESS = {
    "N/m": Unit(1, 1),
    "N/mm": Unit(1000, 1),
    "kN/m": Unit(1000, 1),
    "kN/mm": Unit(1_000_000, 1),
    "MN/m": Unit(1_000_000, 1),
}
Floats = NDArray[np.float64]
WEIGHT = "weight"
MOST_BYTES = 2**25  # of a file
LARGEST = 1e30  # number in it
END = 1 + 1e-9  # of the end of a curve: a measured point up to here is within it
EXAMPLE = 'write heads such as "lift, mm","load, N"'


class MeasuredCurveError(ValueError):
    """A file without a measured curve, or one that a model has no force for; the message is one line."""


class MeasuredCurve(NamedTuple):
    """Forces of a test at n displacements or openings, both positive at the largest force."""

    name: str  # of its file
    displacement: Floats  # (n,) m
    force: Floats  # (n,) N, or N/m
    weight: Floats  # (n,)
    is_per_thickness: bool  # whether forces are in N/m


def read_measured_curve(path: FilePath) -> MeasuredCurve:
    """The measured curve in a CSV file.

    Parameters
    ----------
    path
        A file with one column of displacements or openings (head with a unit of length) and one of forces (N, kN, MN,
        or N/m, N/mm, kN/m, kN/mm, MN/m), and optionally a column `weight`.

    Raises
    ------
    MeasuredCurveError
        For a file that cannot be read, without these columns, or with values that are no finite numbers.
    """
    path = Path(path)
    try:
        text = read_bytes(path, MOST_BYTES).decode("utf-8-sig")
        lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if _has_values(line)]
        table = [next(csv.reader([line], skipinitialspace=True, strict=True)) for _, line in lines]
    except OSError as error:
        raise MeasuredCurveError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise MeasuredCurveError(f"{path}: {error}; write a table in CSV, in UTF-8") from None
    if len(table) < 2:
        raise MeasuredCurveError(f"{path}: {len(table)} lines with values; give a head and a line for each point")
    heads = [_name_and_unit(head) for head in table[0]]
    way, length = _column(path, heads, UNITS, "length")
    load, force = _column(path, heads, FORCES | FORCES_PER_THICKNESS, "force")
    weights = [at for at, (name, unit) in enumerate(heads) if name.lower() == WEIGHT and not unit]
    chosen = [way, load, *weights[:1]]
    values = np.array(
        [_values(path, number, row, chosen) for (number, _), row in zip(lines[1:], table[1:], strict=True)]
    )
    curve = MeasuredCurve(
        str(path),
        *_positive_at_peak(length.to_si(values[:, 0]), force.to_si(values[:, 1])),
        values[:, 2] if weights else np.ones(len(values)),
        heads[load][1] in FORCES_PER_THICKNESS,
    )
    if not (curve.force.any() and curve.displacement.any()):
        raise MeasuredCurveError(f"{path}: all forces or all displacements are 0; give a measured curve")
    if not ((curve.weight >= 0).all() and curve.weight.any()):
        raise MeasuredCurveError(f"{path}: a weight is negative, or all are 0; use weights from 0")
    return curve


def _positive_at_peak(displacement: Floats, force: Floats) -> tuple[Floats, Floats]:
    """A curve with the signs at which displacement and force are positive at the largest force."""
    peak = int(np.abs(force).argmax())
    return displacement * (np.sign(displacement[peak]) or 1.0), force * (np.sign(force[peak]) or 1.0)


def _has_values(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _name_and_unit(head: str) -> tuple[str, str]:
    """The name and the unit in the head of a column, such as "lift, mm"."""
    name, _, unit = head.rpartition(",")
    return (name.strip(), unit.strip()) if name else (unit.strip(), "")


def _column(path: Path, heads: Sequence[tuple[str, str]], units: Mapping[str, Unit], kind: str) -> tuple[int, Unit]:
    """The number and the unit of the one column in a unit of this kind. Raises MeasuredCurveError."""
    fitting = [at for at, (_, unit) in enumerate(heads) if unit in units]
    if len(fitting) == 1:
        return fitting[0], units[heads[fitting[0]][1]]
    names = ", ".join(f"'{name}, {unit}'" if unit else f"'{name}'" for name, unit in heads)
    problem = f"{len(fitting)} columns have" if fitting else "no column has"
    raise MeasuredCurveError(
        f"{path}: {problem} a unit of {kind} ({', '.join(units)}) in {names}; give one, and {EXAMPLE}"
    )


def _values(path: Path, number: int, row: Sequence[str], columns: Sequence[int]) -> list[float]:
    """The numbers of one line. Raises MeasuredCurveError."""
    values = []
    for column in columns:
        word = row[column] if column < len(row) else ""
        try:
            value = float(word)
        except ValueError:
            value = np.nan
        if not abs(value) <= LARGEST:
            raise MeasuredCurveError(
                f"{path}, line {number}: '{word[:40]}' is no finite number of at most {LARGEST:g}; write one"
            )
        values.append(value)
    return values


def scale_to_model(curve: MeasuredCurve, dimension: int, thickness: float | None, option: str) -> MeasuredCurve:
    """The curve with forces as a model has them: in N/m of a 2D model, divided by the `thickness`, m, or N in 3D.

    `option` is what gives the thickness, in the message. Raises MeasuredCurveError for a thickness that is missing, or
    of no use.
    """
    if thickness is not None and not 1e-9 <= thickness <= 1e9:
        raise MeasuredCurveError(f"{option} is {thickness:g} m; use a thickness from 1e-9 to 1e9 m")
    if dimension == 3 and curve.is_per_thickness:
        raise MeasuredCurveError(f"{curve.name}: forces are per thickness, and the model is 3D; give them in N")
    if dimension == 3 or curve.is_per_thickness:
        if thickness is not None:
            reason = "the model is 3D" if dimension == 3 else "forces are per thickness"
            raise MeasuredCurveError(f"{curve.name}: {option} is not used, as {reason}; leave it out")
        return curve
    if thickness is None:
        raise MeasuredCurveError(
            f"{curve.name}: forces are in N, and those of a 2D model in N/m; give the thickness of the specimen, m,"
            f" with {option}"
        )
    return curve._replace(force=curve.force / thickness, is_per_thickness=True)


def load_displacement_points(results: Results, condition: str, gap: str | None = None) -> tuple[Floats, Floats]:
    """Displacement (t,), m, and force (t,) of a condition, as `pdpost reaction` has them, positive at the peak.

    With a named `gap`, its opening is in the place of the displacement. Raises ResultsError.
    """
    (history,) = select_condition_force_histories(read_condition_force_histories(results), [condition])
    force, axis = history.force[:, history.main_axis], history.main_axis
    if gap is None:
        return _positive_at_peak(history.displacement[:, axis].astype(float), force.astype(float))
    curve = force_over_gap_opening(read_named_gap(results, gap), history, axis)
    return _positive_at_peak(curve.opening.astype(float), curve.force.astype(float))


def force_at_displacements(at: Floats, displacement: Floats, force: Floats) -> Floats:
    """Forces of a curve (t,) at displacements `at` (n,), as a test under displacement control has them.

    Linear between those points of the curve whose displacement is larger than all before: over a snap-back, the force
    falls to where the displacement increases again. The curve begins at the origin; beyond its end, the last force
    stands.
    """
    ahead = displacement > _largest_before(displacement)
    way, load = (np.concatenate([[0.0], column[ahead]]) for column in (displacement, force))
    return np.asarray(np.interp(at, way, load))


def misfit(curve: MeasuredCurve, displacement: Floats, force: Floats) -> tuple[float, int]:
    """Root mean square difference over the largest measured force, and the number of points that are compared.

    They do not go back, and are within the computed curve (t,); NaN if there are none.
    """
    way, load = _positive_at_peak(curve.displacement, curve.force)
    displacement, force = _positive_at_peak(displacement, force)
    inside = goes_on(way) & (way <= displacement.max() * END) & (curve.weight > 0)
    if not inside.any():
        return float("nan"), 0
    off = force_at_displacements(way[inside], displacement, force) - load[inside]
    weight = curve.weight[inside]
    return float(np.sqrt(np.sum(weight * off**2) / np.sum(weight)) / np.abs(load[inside]).max()), int(inside.sum())


def goes_on(displacement: Floats) -> NDArray[np.bool_]:
    """Which points (n,) of a measured curve do not go back: their displacement is not below one before."""
    return displacement >= _largest_before(displacement)


def _largest_before(displacement: Floats) -> Floats:
    """The largest displacement (n,) before each point, 0 at least."""
    return np.concatenate([[0.0], np.maximum.accumulate(np.maximum(displacement, 0.0))[:-1]])
