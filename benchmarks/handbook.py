"""Stress intensities of cracked plates at rest against the handbook's: python -m benchmarks.handbook [-o FILE]

Writes `docs/handbook.md`. The plates are bonds in plane stress, 80 spacings wide; loads are tractions, for which the
classical intensities do not depend on Poisson's ratio.
"""

from __future__ import annotations

from pdmesh import Material, Run, Static

WIDE = 80  # spacings of a plate's width
REST = Run(solver="static", static=Static(load_steps=1, floating=True))
UNIT = Material(E=1.0, rho=1.0, G0=1e9)
TADA = "H. Tada, P. C. Paris, G. R. Irwin, The Stress Analysis of Cracks Handbook, 3rd edition, ASME, 2000"
ASTM = "ASTM E399"
