"""A compact-tension specimen with three holes beside the path of its crack, under a load that repeats.

Source: D. Wagner, thesis, University of Texas at San Antonio (2018), specimen 17-157; W = 40 mm.
"""

from pdmesh import Circle, Fatigue, Material, ParticleRules, Run, Scene, box

spacing = 5e-4  # m: between nodes
W = 0.04  # m: from the load line to the back
height = 1.6e-3  # m: of the crack above the middle; tested with 0.8e-3 and -1.6e-3, too
load = 3e5  # N/m, the largest of a cycle
steps = 15  # particles of two spacings

steel = Material(E=200e9, rho=7850, G0=1e9)  # it tears nowhere
fatigue = Fatigue(C=1.2e-37, m=4)  # da/dN = C dK^m, m a cycle at 1 Pa m^0.5
rules = ParticleRules(spacing=2)
run = Run(solver="static", steps=steps, every=1, cracks="particles", particles=rules, fatigue=fatigue)
pin, arm, pad, beside = 0.125 * W, 0.275 * W, 3e-3, 1.2 * spacing

scene = (
    Scene(box(-0.25 * W, -0.6 * W, W, 0.6 * W), spacing, steel, 3.0, run)
    .hole(Circle(0.45 * W, 0.25 * W, 0.1 * W))
    .hole(Circle(0.75 * W, 0, 0.05 * W))
    .hole(Circle(0.625 * W, -0.25 * W, 0.1 * W))
    .crack([(-0.25 * W, height), (0.2 * W, height)])
    .fix(box(W - beside, -beside, W, beside), y=None, name="back")
    .fix(box(W - beside, 0, W, beside), x=None, name="level")
)
for side, name in ((1, "upper"), (-1, "lower")):
    y = side * (arm + pin + spacing)
    scene = scene.hole(Circle(0, side * arm, pin)).load([(-pad, y), (pad, y)], (0, side * load / (2 * pad)), name=name)
