"""A block of rubber is stretched between clamps to one and a half times its length (plane strain, quasi-static).

Source: the nonlinear materials that the slides on gradients of higher order name (Psi = mu / 2 (I1 - 3) - mu ln J +
lambda / 2 (ln J)^2). Finite elements give a reaction of 0.42257 E; the middle narrows by 0.08558 of the side.
Calibrated: nothing; the clamps are the outermost columns.
"""

from pdmesh import Material, Run, Scene, Static, box

spacing = 0.05  # m: between nodes
horizon = 3.0  # horizon over spacing
stretch = 0.5  # m: of a block of 1 m

rubber = Material(E=1, rho=1, G0=1, nu=0.3, plane="strain", model="correspondence", solid="neo hooke", failure="none")
pull = ((0.0, 0.0), (1.0, 1.0))

scene = (
    Scene(box(0, 0, 1, 1), spacing, rubber, horizon, Run(solver="static", static=Static(load_steps=5)))
    .fix("left", rows=1, name="held")
    .fix("right", x=stretch, y=0, rows=1, profile=pull, name="pulled")
)
