"""A layer of mud on a base dries until it cracks into polygons.

Water leaves everywhere at once, and the layer shrinks; its base, springs to the ground, holds it back. Pieces are a few
times as wide as the length sqrt(E thickness / stiffness) within which the base takes over what a crack lets go.
Source: layers of wet powder on glass plates, whose pieces are the wider the thicker the layer (A. Groisman, E. Kaplan,
Europhys. Lett. 25 (1994) 415-420); none of them is solved.
Calibrated: all numbers. The layer dries within tenths of a second, so that it moves in few steps; `damping` takes what
waves hold. Its toughness differs from place to place, at random.
"""

from random import Random

import msgspec

from pdmesh import Circle, Material, Medium, Run, Scene, box

length = 0.12  # m
thickness = 0.005  # m
spacing = 1e-3  # m
E = 1e6  # Pa
toughness = 0.8  # J/m^2
scatter = 0.6  # share of the toughness that a spot lacks at most
spots = 30
seed = 1
stiffness = 3e7  # N/m^3, Pa for each metre, of the base
shrinkage = 0.024  # strain of a free layer that is dry
duration = 0.16  # s
damping = 200.0  # 1/s

mud = Material(E=E, rho=1800.0, G0=toughness, micromodulus="constant", alpha=shrinkage, T0=1.0)  # T: water, of 1
run = Run(duration=duration, every=100, damping=damping)
layer = box(0, 0, length, length)

scene = (
    Scene(layer, spacing, mud, 3.0, run, medium=Medium(D=1e-6))
    .supply(layer, rate=-1 / duration, name="air")
    .spring(layer, body_stiffness=(stiffness / thickness, stiffness / thickness), name="base", breakable=True)
)
chance = Random(int(seed))
for number in range(int(spots)):
    place = Circle(length * chance.random(), length * chance.random(), spacing * (1 + 2 * chance.random()))
    weak = msgspec.structs.replace(mud, G0=toughness * (1 - scatter * chance.random()))
    scene = scene.region(place, weak, name=f"spot {number + 1}")
