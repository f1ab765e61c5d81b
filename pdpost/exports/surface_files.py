"""The surface of a crack as a file of triangles: VTP for ParaView, with times and speeds, and STL, binary."""

from __future__ import annotations

from base64 import b64encode
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import write_atomically
from pdpost.exports.frame_files import ExportError
from pdsolve.measures.crack_3d import front_speeds_below_limit
from pdsolve.measures.crack_faces import CrackSurface, build_crack_surface, find_opened_face_neighbours
from pdsolve.results import Results

SUFFIXES = (".vtp", ".stl")
STL_HEADER = 80  # bytes
VTP = """<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<PolyData>
<Piece NumberOfPoints="{points}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="{polys}">
<Points>{places}</Points>
<Polys>{corners}{ends}</Polys>
<CellData>{data}</CellData>
</Piece>
</PolyData></VTKFile>
"""
TYPES = {"f": "Float64", "i": "Int64"}


def check_suffix(path: Path) -> None:
    """Raise ExportError for a suffix that no surface is written with."""
    if path.suffix.lower() not in SUFFIXES:
        raise ExportError(f"{path}: suffix '{path.suffix}' is not known; use {' or '.join(SUFFIXES)}")


def write(path: Path, cracks: CrackSurface, speed: NDArray[np.float64]) -> None:
    """Write a crack's surface: with opening times (s; -1 of pre-cracks) and the front's `speed` (f,), m/s, as VTP."""
    check_suffix(path)
    write_atomically(path, vtp(cracks, speed) if path.suffix.lower() == ".vtp" else stl(cracks))


def write_frame(path: Path, results: Results, step: int) -> None:
    """Write the surface of the cracks of a body after `step`."""
    cracks = build_crack_surface(results, step, find_opened_face_neighbours(results, step))
    write(path, cracks, front_speeds_below_limit(results, cracks))


def vtp(cracks: CrackSurface, speed: NDArray[np.float64]) -> bytes:
    """The surface as VTK PolyData."""
    polys = cracks.face_corners
    return VTP.format(
        points=len(cracks.corners),
        polys=len(polys),
        places=_array("Points", cracks.corners, 3),
        corners=_array("connectivity", polys.ravel()),
        ends=_array("offsets", polys.shape[1] * np.arange(1, len(polys) + 1)),
        data=_array("opened", cracks.opening_time) + _array("speed", speed) + _array("area", cracks.face_area),
    ).encode()


def _array(name: str, values: NDArray[np.generic], components: int = 1) -> str:
    """An array of VTK's: the length of its bytes and the bytes, in base64."""
    kind, raw = TYPES[values.dtype.kind], values.astype(values.dtype.newbyteorder("<")).tobytes()
    text = b64encode(np.array(len(raw), dtype="<u8").tobytes() + raw).decode()
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="binary">{text}</DataArray>'
    )


def stl(cracks: CrackSurface) -> bytes:
    """The surface as binary STL, two triangles a face, in m."""
    quads = cracks.corners[cracks.face_corners]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    rows = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["normal"], rows["corners"] = normal, triangles
    return b"surface of a crack, m".ljust(STL_HEADER) + np.uint32(len(rows)).tobytes() + rows.tobytes()
