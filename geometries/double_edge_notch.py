"""Two edge cracks, one above the other, grow towards each other in a plate that is pulled apart slowly.

Source: the usual specimen of PMMA with notches that are not in one line. It is solved at rest. Each crack grows when
the stress intensity at its tip reaches the toughness, sqrt(E G0). A tip without room for a ring around it does not
grow.
Calibrated: nothing.
"""

from pdmesh import Material, ParticleRules, Run, Scene, Static, box, ramp

spacing = 1e-3  # m: between nodes
width, height = 0.06, 0.08  # m
crack = 0.015  # m: length of each
offset = 0.01  # m: between their heights
opening = 3.5e-4  # m: that the upper edge is moved away from the lower one
load_steps = 7
horizon = 3.0  # horizon over spacing

pmma = Material(E=3e9, rho=1190, G0=350)
rules = ParticleRules(criterion="intensity")
run = Run(solver="static", static=Static(load_steps=int(load_steps)), cracks="particles", particles=rules)

scene = (
    Scene(box(0, 0, width, height), spacing, pmma, horizon, run)
    .crack([(0, (height + offset) / 2), (crack, (height + offset) / 2)])
    .crack([(width, (height - offset) / 2), (width - crack, (height - offset) / 2)])
    .fix("bottom", rows=1)
    .fix("top", x=0, y=opening, rows=1, profile=ramp(1.0))
)
