"""A square of rubber is bent about an axis below it and rotated by 30 degrees (plane strain, quasi-static).

Source: a reconstruction of the example of bending and turning in the slides on gradients of higher order. A node moves
to R ((1/2 + Y) sin X, (1/2 + Y) cos X - 1/2), which turns the corner (0, 0) by 30 degrees. Gradients of order 1, 3, 5
and 7 at this corner give a rotation of 1.35, 31.35, 29.99 and 30.00 degrees (the slides say "35" for the third order).
Calibrated: the layer with prescribed displacements, two horizons wide, and the body force that holds the other nodes.
"""

from math import cos, log, radians, sin

from pdmesh import Material, Run, Scene, Static, box

spacing = 0.0625  # m: between nodes
horizon = 3.0  # horizon over spacing
order = 1  # of gradients
turn = 30.0  # degrees
load_steps = 6

nu = 0.3
rubber = Material(
    E=1, rho=1, G0=1, nu=nu, plane="strain", model="correspondence", solid="neo hooke", order=int(order),
    failure="none",
)  # fmt: skip
first, shear = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))
layer, nodes = 2 * horizon * spacing, round(1 / spacing) + 1
c, s = cos(radians(turn)), sin(radians(turn))
up = ((0.0, 0.0), (1.0, 1.0))

scene = Scene(box(0, 0, 1, 1), spacing, rubber, horizon, Run(solver="static", static=Static(load_steps=load_steps)))
for column in range(nodes):
    for row in range(nodes):
        X, Y = column * spacing, row * spacing
        here = box(X - spacing / 4, Y - spacing / 4, X + spacing / 4, Y + spacing / 4)
        r, x, y = 0.5 + Y, sin(X), cos(X)
        if min(X, 1 - X, Y, 1 - Y) < layer - spacing / 4:
            u, v = c * r * x - s * (r * y - 0.5) - X, s * r * x + c * (r * y - 0.5) - Y
            scene = scene.fix(here, x=u, y=v, profile=up, name="moved")
        else:
            b = shear * (r - 1 / r) + first * log(r) / r - first / r
            force = (b * (c * x - s * y), b * (s * x + c * y))
            scene = scene.load(here, body_force=force, profile=up, name="kept")
