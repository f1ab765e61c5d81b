"""Kalthoff and Winkler's plate in 3D, with the settings of a regression test of CabanaPD.

Source: CabanaPD (Oak Ridge National Laboratory), regression_test/inputs/kalthoff_winkler.json: 75 x 151 x 7 cells in a
steel plate of 100 x 200 x 9 mm with two notches of 50 mm, horizon 2 mm, 16 m/s of the first layer between the notches,
0.1 us for 700 steps. Its own number: nodes with a damage above 0.3 reach 74.2 mm from the plate's middle line.
Here cells are cubes of 4/3 mm: 75 x 150 x 7, so that the plate is 9.33 mm thick. The notches lie between rows of nodes.
Calibrated: nothing.
"""

from pdmesh import Body, Box, Material, Run

height, width = 0.1, 0.2  # m: along x and y
spacing = height / 75  # m: between nodes
horizon = 1.5  # horizon over spacing
speed = 16.0  # m/s: of the struck layer, held
duration = 70e-6  # s
notch, apart = height / 2, width / 8  # m: length of the notches, and how far they are from the middle line
thickness = 7 * spacing  # m

steel = Material(E=191e9, rho=8000, G0=42408, micromodulus="constant")
x, z = height / 2, thickness / 2
scene = Body(
    Box((-x, -width / 2, -z), (x, width / 2, z)),
    spacing,
    steel,
    horizon,
    Run(time_step=1e-7, duration=duration, every=50),
).move(
    Box((-x - spacing, -apart, -2 * z), (spacing - x, apart, 2 * z)),
    velocity=(speed, 0, 0),
    breakable=True,
    name="impact",
)
for y in (-apart, apart):
    corners = [(-x - spacing, y, -2 * z), (notch - x, y, -2 * z), (notch - x, y, 2 * z), (-x - spacing, y, 2 * z)]
    scene = scene.crack([[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]])
