"""Reading drawings of strangers: a list of what they may say, and a process that could do no harm.

A .geo file is a program. `scan` lets through what is known to be harmless and nothing else, `copies` writes what was
let through anew into an empty folder, and `reader` has Gmsh read it there, behind the walls of `walls`.
"""
