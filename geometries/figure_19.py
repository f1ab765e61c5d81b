"""A plate with a free-form hole, a row of bores, rounded notches, an inclusion and a curved crack.

Source: in the spirit of figure 19 of A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione di
tecniche di grid generation e refinement nell'analisi peridinamica 2D" (5408 nodes; the figure itself is lost).
Calibrated: everything; the shape, the zones and the loads are free inventions around that number of nodes.
Three scales: both zones are grown by the horizon of the nodes they replace.
"""

import numpy as np

from pdmesh import Circle, Material, Run, Scene, box, ramp

spacing = 2e-3  # m: between the coarsest nodes
pull = 8e6  # Pa: on the right edge
cut = 0.014  # m: chord of the curved crack

glass = Material(E=72e9, rho=2440, G0=135)
core = Material(E=65e9, rho=2235, G0=204)

angle = np.linspace(0, 2 * np.pi, 120, endpoint=False)
radius = 0.011 * (1 + 0.25 * np.cos(3 * angle) + 0.1 * np.sin(5 * angle))
cloud = list(zip(0.05 + radius * np.cos(angle), 0.035 + radius * np.sin(angle), strict=True))

turn = np.linspace(-0.5, 0.5, 12)
arc = [(0.0853 + cut * t, 0.0393 + 0.8 * cut * (0.25 - t**2)) for t in turn]

outline = [
    (0, 0),
    (0.13, 0),
    (0.13, 0.025),
    (0.105, 0.025),
    (0.105, 0.05),
    (0.13, 0.05),
    (0.13, 0.08),
    (0.02, 0.08),
    (0, 0.06),
]

scene = Scene(outline, spacing, glass, 3, Run(time_step=50e-9, steps=1000, every=50)).hole(cloud)
for x in (0.025, 0.045, 0.065):
    scene = scene.hole(Circle(x, 0.065, 0.004))
scene = (
    scene.notch(Circle(0.03, -0.002, 0.008))
    .notch([(0.0705, 0), (0.0745, 0.012), (0.0785, 0)])
    .crack(arc, "arc")
    .zone(box(0.06, 0.028, 0.102, 0.053), 1e-3, "ligament")
    .zone(box(0.077, 0.036, 0.094, 0.046), 5e-4, "crack")
    .region(Circle(0.09, 0.066, 0.008), core, "inclusion")
    .load("right", traction=(pull, 0), rows=2, profile=ramp(5e-6))
    .fix([(0, 0), (0, 0.06)], rows=2, name="clamp")
)
