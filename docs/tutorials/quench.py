"""A slab of glass that is quenched on both sides, at rest after each step of conduction; a half of it is solved.

The whole slab is as thick as 2 a and four times as long; Bi = h a / k.
"""

from pdmesh import Heat, Material, Run, Scene, box

Bi = 10.0
a = 5e-3  # m: half of the thickness
rows = 18  # of nodes across that
cold, hot = 293.0, 393.0  # K
k, rho, c = 1.0, 2500.0, 800.0  # W/(m K), kg/m^3, J/(kg K)
last = 0.06  # of a^2 / D, when the run ends
steps = 16

D, long, spacing = k / (rho * c), 8 * a, a / rows
point = spacing / 4
glass = Material(E=70e9, rho=rho, G0=1e6, alpha=9e-6, T0=hot)  # it cracks nowhere
run = Run(solver="static", time_step=last * a**2 / D / steps, steps=steps, every=4, theta=0.6)
scene = (
    Scene(box(0, 0, a, long), spacing, glass, 3.0, run, medium=Heat(k=k, c=c))
    .initial_temperature(box(-1, -1, 1, 1), hot)
    .convection("left", h=Bi * k / a, outside=cold)
    .fix("right", y=None, name="middle")
    .fix(box(a - point, long / 2 - point, a, long / 2 + point), x=None, name="level")
)
