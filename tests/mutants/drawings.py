"""Lines of the reader of drawings, each broken by hand."""

from __future__ import annotations

from mutants.mutant import Mutant

DRAWINGS = (
    Mutant(
        "pdmesh/drawing/sandbox/walls.py",
        "FOR_WRITING = 0o1 | 0o2 | 0o100 | 0o1000",
        "FOR_WRITING = 0o1 | 0o2 | 0o1000",
        "tests/sandbox/test_walls.py::test_each_wall_stops_its_deeds",
    ),
    Mutant(
        "pdmesh/drawing/sandbox/walls.py",
        '        "NPROC": 0,\n',
        "",
        "tests/sandbox/test_walls.py::test_each_wall_stops_its_deeds",
    ),
    Mutant(
        "pdmesh/drawing/sandbox/tokens.py",
        'SKIPPING = {"If", "For"}',
        'SKIPPING = {"If"}',
        "tests/unit/pdmesh/drawing/test_tokens.py",
    ),
)
