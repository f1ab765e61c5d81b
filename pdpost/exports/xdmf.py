"""XDMF: an XML file that describes the data, and the raw numbers in a .bin file beside it (xdmf.org, Model and Format).

Constant data is written once; nodes are written again when they change. Programs that know no `Seek` into a .bin file,
such as meshio, read numbers that are written as text into the XML file itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import BinaryIO, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import replacing, write_atomically
from pdmesh.plain_text import for_file_name

CELLS = {"vertex": "Polyvertex", "quad": "Quadrilateral", "hexahedron": "Hexahedron"}  # meshio's word: XDMF's
RANKS = {1: "Scalar", 3: "Vector", 9: "Tensor"}  # by how many numbers there are
KINDS = {"f": "Float", "i": "Int", "u": "UInt"}

Data = Mapping[str, NDArray[np.generic]]  # (n,), (n, 3) or (n, 9) by name


class MeshPoints(NamedTuple):
    """Points and cells that the data belongs to."""

    points: NDArray[np.float64]  # (n, 3) m
    cells: tuple[str, NDArray[np.int64]]  # of which kind, and which points are its corners
    data: Data  # that all of its frames have


class XdmfFrame(NamedTuple):
    """Data at one time."""

    time: float  # s
    data: Data
    cloud: MeshPoints | None  # None: as in the frame before


def write(path: Path, frames: Iterable[XdmfFrame], inline: bool = False) -> None:
    """Write frames; the first must have a cloud. `inline`: numbers as text in the file itself."""
    root = Element("Xdmf", Version="3.0")
    series = SubElement(
        SubElement(root, "Domain"), "Grid", Name="frames", GridType="Collection", CollectionType="Temporal"
    )
    numbers = beside(path)
    if inline:
        _describe(series, frames, _spell)
    else:
        with replacing(numbers) as part, part.open("wb") as file:
            _describe(series, frames, partial(_put, file, numbers.name))
    write_atomically(path, ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def _describe(
    series: Element, frames: Iterable[XdmfFrame], store_array: Callable[[NDArray[np.generic]], Element]
) -> None:
    """Append a grid for each frame; `store_array` writes an array and returns the element that refers to it."""
    for time, data, cloud in frames:
        if cloud is not None:
            kind, corners = cloud.cells
            of_cells, of_points = (store_array(array) for array in (corners, cloud.points))
            same = {name: store_array(array) for name, array in cloud.data.items()}
        grid = SubElement(series, "Grid", Name=f"{time!r} s", GridType="Uniform")
        SubElement(grid, "Time", Value=repr(time))
        shape = SubElement(grid, "Topology", TopologyType=CELLS[kind], NumberOfElements=str(len(corners)))
        shape.append(of_cells)
        SubElement(grid, "Geometry", GeometryType="XYZ").append(of_points)
        for name, item in {**{name: store_array(array) for name, array in data.items()}, **same}.items():
            rank = RANKS[int(item.attrib["Dimensions"].split()[1])]
            SubElement(grid, "Attribute", Name=name, AttributeType=rank, Center="Node").append(item)


def beside(path: Path) -> Path:
    """Path of the .bin file that belongs to the XDMF file at `path`."""
    return path.with_name(f"{for_file_name(path.stem)}.bin")


def _put(file: BinaryIO, name: str, array: NDArray[np.generic]) -> Element:
    """Append an array (n,) or (n, k) to the .bin file of that final name; returns the XML element that refers to it."""
    item = _item(array, Format="Binary", Endian="Little", Seek=str(file.tell()))
    item.text = name
    file.write(array.astype(array.dtype.newbyteorder("<")).tobytes())
    return item


def _spell(array: NDArray[np.generic]) -> Element:
    """The XML element that holds an array (n,) or (n, k) as text, from which the same numbers are read."""
    item, spelled = _item(array, Format="XML"), {"f4": "%.9g", "f8": "%.17g"}.get(array.dtype.str[1:], "%d")
    item.text = " ".join([spelled % value for value in array.ravel().tolist()])
    return item


def _item(array: NDArray[np.generic], **more: str) -> Element:
    """An XML element for an array (n,) or (n, k)."""
    shape = " ".join(map(str, array.reshape(len(array), -1).shape))
    kind, size = KINDS[array.dtype.kind], str(array.dtype.itemsize)
    return Element("DataItem", {"Dimensions": shape, "NumberType": kind, "Precision": size, **more})
