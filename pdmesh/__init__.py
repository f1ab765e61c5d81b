"""Geometry to multiscale peridynamic grids: a Gmsh drawing in, the node grid as JSON out."""

VERSION = "0.1.0"
