"""An inclined crack in a pulled plate kinks in the direction of the largest hoop stress (quasi-static).

Source: F. Erdogan, G. C. Sih, J. Basic Eng. 85 (1963) 519-525, with K1 = s sqrt(pi a) cos^2 b and K2 = s sqrt(pi a)
sin b cos b of a crack at b in an infinite plate.
Two scales: half of the crack is twenty fine spacings long, and the plate is six times as wide as the whole crack.
Calibrated: the toughness, so that the crack grows at both ends at every inclination up to 60 degrees.
"""

from math import cos, radians, sin

from pdmesh import Material, ParticleRules, Run, Scene, Static, box

angle = 45.0  # degrees between the crack and the x axis
half = 0.01  # m: half the length of the crack
fine = 5e-4  # m: between nodes around the crack
coarse = 2e-3  # m: between the others
tension = 1e6  # Pa
toughness = 5e4  # Pa m^0.5; K1 of a crack across is 1.8e5
most = 30  # particles grown: fifteen at each end
horizon = 3.0  # horizon over spacing

pmma = Material(E=3e9, rho=1190, G0=350)
rules = ParticleRules(toughness=toughness, most=int(most))
run = Run(solver="static", static=Static(load_steps=1, floating=True), cracks="particles", particles=rules)
x, y = half * cos(radians(angle)), half * sin(radians(angle))

scene = (
    Scene(box(-6 * half, -6 * half, 6 * half, 6 * half), coarse, pmma, horizon, run)
    .zone(box(-1.8 * half, -1.8 * half, 1.8 * half, 1.8 * half), fine, "around the crack")
    .crack([(-x, -y), (x, y)])
    .load("top", traction=(0, tension), rows=1)
    .load("bottom", traction=(0, -tension), rows=1)
)
