"""Reads drawings of unknown origin safely: an allow-list of words, and a confined process.

A .geo file is a program. `scan` admits only what is known to be harmless, `copies` writes the admitted text into an
empty folder, and `gmsh_reader` has Gmsh read it there, confined by `walls`.
"""
