"""A steel beam in quasi-static three-point bending. Contact with rollers, which are bodies, is its only support.

Source: the beam of Timoshenko, F L^3 / (48 E I) + F L / (4 k G A) with k = 5/6, for the sag between the rollers.
Calibrated: nothing. Bonds have nu = 1/3. The lower halves of two rollers and the upper half of the third one are held;
friction keeps the beam from sliding off.
"""

from shapely import Point

from pdmesh import Material, Run, Scene, Static, box, ramp

layers = 10  # spacings over the height
horizon = 3.0  # horizon over spacing
way = 2e-4  # m: of the upper roller in the end
friction = 0.05
length, height, span, radius = 0.2, 0.02, 0.16, 0.01  # m
load_steps = 4

steel = Material(E=200e9, rho=7850, G0=1e5, plane="stress", micromodulus="constant")
spacing = height / layers
left, right = (length - span) / 2, (length + span) / 2  # m
rollers = {"left": (left, -radius), "right": (right, -radius), "middle": (length / 2, height + radius)}

scene = Scene(
    box(0, 0, length, height),
    spacing,
    steel,
    horizon,
    Run(solver="static", static=Static(load_steps=load_steps)),
)
for name, place in rollers.items():
    scene = scene.body(Point(*place).buffer(radius), name)
for name, (x, y) in rollers.items():
    up = y > 0
    half = box(x - radius, y if up else y - radius, x + radius, y + radius if up else y)
    moves = -way if up else 0.0
    scene = scene.fix(half, x=0.0, y=moves, profile=ramp(1), name=name)
scene = scene.contact(friction=friction).load_cell("supports", "left", "right")
