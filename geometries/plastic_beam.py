"""A beam of steel is bent to four times the curvature of first yield (plane strain, quasi-static).

Source: an example of the forming that the slides on gradients of higher order mention. The moments of the classical
beam, fibre by fibre (sigma_yy = 0, no strain out of the plane), are 1, 1.3930, 1.4733 and 1.5022 of the yield moment.
Calibrated: nothing. Three columns at each end are turned about its middle, and can contract freely.
"""

from pdmesh import Material, Run, Scene, Static, box

layers = 10  # spacings over the height
horizon = 3.0  # horizon over spacing
E = 200e9  # Pa
nu = 0.3
strength = 250e6  # Pa: at which it flows
steps = 16

height, length, spacing = 0.1, 0.3, 0.1 / layers  # m
# strain of an edge that begins to flow, where sigma_zz = nu sigma_xx, over half of the height
first = 2 * strength * (1 - nu**2) / (E * (1 - nu + nu**2) ** 0.5) / height
steel = Material(
    E=E, rho=7850, G0=1e4, nu=nu, plane="strain", model="correspondence", solid="j2", yield_stress=strength,
    control_factor=0.1, failure="none",
)  # fmt: skip


def node(x, y):
    """A box around one node."""
    return box(x - spacing / 4, y - spacing / 4, x + spacing / 4, y + spacing / 4)


scene = Scene(
    box(-length / 2, -height / 2, length / 2, height / 2), spacing, steel, horizon,
    Run(solver="static", static=Static(load_steps=steps)),
).fix(node(0, 0), x=None, name="middle")  # fmt: skip
for column in range(3):
    for row in range(layers + 1):
        for side in (-1, 1):
            x, y = side * (length / 2 - column * spacing), row * spacing - height / 2
            scene = scene.fix(node(x, y), x=4 * first * x * y, y=None, profile=((0.0, 0.0), (4.0, 1.0)), name="ends")
