"""A compact-tension specimen of PMMA is pulled apart slowly. Its crack grows stably as the pins move.

Source: the shape is that of ASTM E399 (W = 50 mm, a / W = 0.5). Pins are stiff discs instead of holes; each turns about
the node at which it is pulled. The load line is x = 0, and the pins are moved apart by 1 mm a minute.
Two scales: fine around the pins and along the path of the crack, which lies between rows of nodes on both scales.
Calibrated: nothing. Bonds in plane strain always have nu = 1/4. The ordinary solid (`--set model=ordinary`) has the
material's nu; its crack does not grow here, as each of its many rounds takes seconds.
"""

from pdmesh import Circle, Material, Run, Scene, Static, box, ramp

spacing = 1e-3  # m: between the coarsest nodes
fine = 5e-4  # m: between nodes along the way of the crack
horizon = 4.0  # horizon over spacing
W = 0.05  # m: from the load line to the back
crack = 0.025  # m: from the load line to its end
opening = 6e-4  # m: that the pins are moved apart in the end
load_steps = 24
model = "bond"  # or "ordinary"
nu = 0.36  # of PMMA, for the ordinary solid

solid = {"plane": "strain"}
if model == "bond":
    pmma, steel = Material(E=3e9, rho=1190, G0=350, **solid), Material(E=200e9, rho=7850, G0=1e5, **solid)
else:
    solid |= {"model": model, "failure": "none"}
    pmma, steel = (
        Material(E=3e9, rho=1190, G0=350, nu=nu, **solid),
        Material(E=200e9, rho=7850, G0=1e5, nu=0.3, **solid),
    )
half, pin = 0.6 * W - fine / 2, fine * (0.275 * W // fine + 0.5)
run = Run(solver="static", static=Static(load_steps=load_steps))

scene = (
    Scene(box(-0.25 * W, -half, W, half), spacing, pmma, horizon, run)
    .zone(box(crack - 0.005, -0.004, W, 0.004), fine, "way")
    .crack([(-0.25 * W, 0), (crack, 0)])
)
for side, name in ((1, "upper pin"), (-1, "lower pin")):
    middle = box(-fine / 4, side * pin - fine / 4, fine / 4, side * pin + fine / 4)
    scene = (
        scene.zone(Circle(0, side * pin, 0.14 * W), fine, name, grown=False)
        .region(Circle(0, side * pin, 0.125 * W), steel, name)
        .fix(middle, x=0, y=side * opening / 2, profile=ramp(60 * opening / 1e-3), name=name)
    )
