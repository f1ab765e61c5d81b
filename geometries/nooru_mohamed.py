"""A double-edge-notched plate of concrete is sheared by a dead load and then pulled apart (quasi-static).

Source: M. B. Nooru-Mohamed, thesis, Delft (1992), load path 4b: 200 x 200 x 50 mm, notches of 25 x 5 mm, E = 32.8 GPa,
f_t = 3 MPa, G_f = 110 J/m^2, a shear of 10 kN at the left of the upper half, then a pull of the upper edge.
Calibrated: nothing. Bonds have shear and a free rotation, so that nu is 0.2. The tests have two curved cracks. Here too
there are two, one from each notch, which pass each other, but they run flatter.
"""

from pdmesh import Material, Run, Scene, Static, box, ramp

spacing = 0.005  # m: between nodes
horizon = 3.0  # horizon over spacing
shear = 10e3  # N
pull = 2e-4  # m: of the upper edge in the end
load_steps = 40  # in which a crack would go through
size, thickness = 0.2, 0.05  # m
notch, slot = 0.025, 0.005  # m: depth and width
gauge = 0.01  # m: from the middle to the ends of the monitored openings

cohesive = {"law": "cohesive", "f_t": 3e6, "shape": "bilinear", "micromodulus": "constant"}
concrete = Material(E=32.8e9, rho=2400, G0=110, model="micropolar", nu=0.2, **cohesive)
low, high = size / 2 - slot / 2, size / 2 + slot / 2
outline = box(0, 0, size, size) - box(0, low, notch, high) - box(size - notch, low, size, high)
run = Run(solver="static", static=Static(load_steps=load_steps))

scene = (
    Scene(outline, spacing, concrete, horizon, run)
    .fix("bottom", rows=1, name="foot")
    .fix([(size, 0), (size, low)], y=None, rows=1, name="right")
    .load([(0, high), (0, size)], traction=(shear / thickness / low, 0), rows=1, name="shear")
    .fix("top", x=None, y=pull, rows=1, profile=ramp(1), name="top")
    .gap("left", (notch, size / 2 - gauge), (notch, size / 2 + gauge))
    .gap("right", (size - notch, size / 2 - gauge), (size - notch, size / 2 + gauge))
)
