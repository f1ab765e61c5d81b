"""A hot slab of alumina falls into water. Parallel cracks grow; more and more of them stop.

Source: slabs of 99 % alumina of 50 x 10 x 1 mm in stacks, whose rims alone meet the water (C. P. Jiang, X. F. Wu,
J. Li, F. Song, Y. F. Shao, X. H. Xu, P. Yan, Acta Mater. 60 (2012) 4540-4550); a quarter of one is solved.
Calibrated: `h`, which is not known in boiling water; `mass` times the density makes waves slower by its root, and
`damping` takes their energy: conduction is slower than either still.
"""

from pdmesh import Material, Medium, Run, Scene, box

length, half = 0.025, 0.005  # m: half of the slab, and of its thickness
spacing = 1e-4  # m
horizon = 3.0  # horizon over spacing
hot = 380.0  # K: how much hotter than the water it is
h = 5e4  # W/(m^2 K)
room = 293.0  # K
duration = 0.1  # s
mass, damping = 1.6e5, 1e3  # -, 1/s: calibrated, see above
rho, k, c = 3980.0, 31.0, 880.0  # kg/m^3, W/(m K), J/(kg K)

alumina = Material(E=370e9, rho=rho * mass, G0=42.47, micromodulus="constant", alpha=7.5e-6, T0=room + hot)
medium = Medium(D=k / (rho * c), carries="heat", heat_capacity=rho * c)
run = Run(duration=duration, every=2000, damping=damping)

scene = (
    Scene(box(0, 0, length, half), spacing, alumina, horizon, run, medium=medium)
    .initial_temperature(box(-1, -1, 1, 1), room + hot)
    .exchange("bottom", coefficient=h / (rho * c), outside=room)
    .exchange("left", coefficient=h / (rho * c), outside=room)
    .fix("top", x=None, rows=1, name="middle")
    .fix("right", y=None, rows=1, name="level")
)
