"""A drawing of a part from a CAD program, with marks where its user fills in material, faces and loads."""

from __future__ import annotations

import math
from string import Template

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.part import CadPart, Shape
from pdmesh.scene.shapes import SceneError

MARK = "FILL_IN"
MOST_LINES = 6  # that a message lists
NODES = {2: 5_000, 3: 8_000}  # about as many as the proposed spacing gives, which solve in minutes
ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # spacings, times a power of ten
NOUNS = {2: ("edge", "Curve", "Surface"), 3: ("face", "Surface", "Volume")}  # what conditions act on, and zones are of
AXES = {2: "xy", 3: "xyz"}
FORCE_UNITS = {2: "N/m", 3: "N"}
FORCE = '  force_{axis} = {{{mark}, Name "Peridynamics/Loads/pull/Force {axis}", Units "{unit}", Help "in total"}},'
TEXT = """\
// A model of $file, $size $unit. Put a value in place of each $mark, then
//   pdmesh build $stem.geo
//   pdsolve $stem.json
// $picture shows the numbers of the ${noun}s. Lengths are in $unit, all else in SI units.

$statements

// 1. The grid: at least three spacings across the thinnest place
DefineConstant[
  unit = {"$unit", Name "Peridynamics/Units"},
  spacing = {$spacing, Name "Peridynamics/Zones/part/Spacing", Help "gives about $nodes nodes"}
];
Physical $whole("zone:part") = {$whole{:}};

// 2. The material; for example 65e9, 2235 and 204 of Duran 50 glass
DefineConstant[
  E = {$mark, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {$mark, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "density"},
  G0 = {$mark, Name "Peridynamics/Material/G0", Units "J/m^2", Help "critical energy release rate"}
];

// 3. Boundary conditions: numbers of ${noun}s, with commas between them
Physical $shape("fix:support") = {$mark};  // does not move
Physical $shape("load:pull") = {$mark};  // carries the force
DefineConstant[
$forces
  growth = {"ramp 1", Name "Peridynamics/Loads/pull/Profile", Help "from 0 to the whole force in 1 s"}
];
// With a displacement in place of the force, a crack grows step by step; what Components omits stays free:
//   Physical $shape("fix:pull") = {$example};
//   DefineConstant[
//     shift = {0.1, Name "Peridynamics/Fixes/pull/Displacement x", Units "$unit"},
//     moves = {"x", Name "Peridynamics/Fixes/pull/Components"},
//     growth = {"ramp 1", Name "Peridynamics/Fixes/pull/Profile"}
//   ];

// 4. The analysis: static for slow loads; explicit, with Run/Duration in s, for impact and fast cracks
DefineConstant[
  solver = {"static", Name "Peridynamics/Run/Solver"},
  steps = {10, Name "Peridynamics/Run/Load steps"}
];
// Slow cracks advance only with longer or stiffer bonds, which take longer to solve:
//   DefineConstant[ profile = {"constant", Name "Peridynamics/Material/Micromodulus"} ];

// The ${noun}s:
$shapes
"""


def refuse_marks(path: object, text: str) -> None:
    """Raise SceneError for a drawing in which marks stand for what its user has to fill in."""
    lines = [str(number) for number, line in enumerate(text.splitlines(), 1) if MARK in line.partition("//")[0]]
    if lines:
        more = f" and {len(lines) - MOST_LINES} more" if len(lines) > MOST_LINES else ""
        lines_text = f"line{'s' * (len(lines) > 1)} {', '.join(lines[:MOST_LINES])}{more}"
        raise SceneError(f"{path}: {lines_text}: {MARK} is not filled in; put a value in its place")


def proposed_spacing(part: CadPart) -> float:
    """A spacing with few digits, in the part's unit, with which the part has some ten thousand nodes."""
    spacing = (part.size / NODES[part.dimension]) ** (1 / part.dimension)
    power = 10.0 ** math.floor(math.log10(spacing))
    return float(f"{min(ROUND, key=lambda digits: abs(digits - spacing / power)) * power:.3g}")


def drawing_text(part: CadPart, picture: str) -> str:
    """The drawing of a part whose faces or edges a picture shows with their numbers."""
    noun, shape, whole = NOUNS[part.dimension]
    spacing, unit = proposed_spacing(part), part.unit
    forces = [FORCE.format(axis=axis, mark=MARK, unit=FORCE_UNITS[part.dimension]) for axis in AXES[part.dimension]]
    several = f"// its {part.count} {whole.lower()}s become one body, joined where they touch"
    size_unit = unit + "^2" * (part.dimension == 3)
    return Template(TEXT).substitute(
        file=part.path.name,
        stem=part.path.stem,
        picture=picture,
        size=" x ".join(f"{side:.4g}" for side in (part.high - part.low)[: part.dimension]),
        unit=unit,
        statements="\n".join([*part.statements, *([several] if part.count > 1 else [])]),
        spacing=f"{spacing:g}",
        nodes=f"{float(f'{part.size / spacing**part.dimension:.2g}'):g}",
        noun=noun,
        shape=shape,
        whole=whole,
        example=part.shapes[0].number,
        forces="\n".join(forces),
        mark=MARK,
        shapes="\n".join(
            f"//   {entry.number:4}  {entry.kind:16} {entry.size:9.4g} {size_unit}, {_place(entry, part)}"
            for entry in part.shapes
        ),
    )


def _place(shape: Shape, part: CadPart) -> str:
    """Where a shape is, in words: from end to end, or around its middle, and which way it faces."""

    def words(place: NDArray[np.float64]) -> str:
        least = 1e-6 * float((part.high - part.low).max())
        return f"({', '.join(f'{value if abs(value) > least else 0:.4g}' for value in place[: part.dimension])})"

    if shape.kind == "line":
        return f"from {words(shape.points[0])} to {words(shape.points[-1])}"
    if shape.normal is None:
        return f"about {words(shape.centre)}"
    normal = ", ".join(f"{round(float(value), 3) + 0.0:g}" for value in shape.normal)
    return f"about {words(shape.centre)}, facing ({normal})"
