"""Two edge cracks, one above the other, grow towards each other as a plate is pulled apart slowly.

Source: the specimen is the usual one with notches that are not in one line; PMMA. At rest, crack by crack as the stress
intensities at its tip reach the toughness, sqrt(E G0); a tip stays where there is no room for a ring around it.
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
    .fix("bottom")
    .fix("top", x=0, y=opening, profile=ramp(1.0))
)
