"""A glass strip is stretched between its long edges and held. Its crack is released and runs at a steady speed.

Source: the strip of J. R. Rice, J. Appl. Mech. 35 (1968) 379-386. Far ahead of the tip the strip stores the energy E
e^2 h / (2 (1 - nu^2)) per length, with strain e, height h and the nu = 1/3 of bonds. Far behind the tip it stores
none.
Calibrated: the strain, which supplies twice the fracture energy, and the step, which is half of the longest step that
is surely stable, so that the energy balance is four times as good.
"""

from pdmesh import Material, Run, Scene, box

spacing = 5e-4  # m: between nodes
horizon = 4.0  # horizon over spacing
length = 0.1  # m
height = 0.03  # m: of the strip, its nodes one spacing less
crack = 0.03  # m: length of the edge crack
fed = 2.0  # energy for the crack over its fracture energy

glass = Material(E=65e9, rho=2235, G0=204)
half = (height - spacing) / 2
strain = (fed * glass.G0 * (1 - 1 / 9) / (glass.E * half)) ** 0.5

run = Run(time_step=6.4e-8, steps=800, every=40, start="static")

scene = (
    Scene(box(0, -half, length, half), spacing, glass, horizon, run)
    .crack([(0, 0), (crack, 0)])
    .fix("top", x=0, y=strain * half, rows=1)
    .fix("bottom", x=0, y=-strain * half, rows=1)
)
