"""A disc of glass with a scratch at its rim is heated in the middle until it cracks (quasi-static).

Source: the free disc of S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., section 150: the hoop stress at
the rim is E alpha times the mean temperature less that of the rim.
Calibrated: all numbers; the glass is a soda-lime glass.
"""

from pdmesh import Circle, Heat, Material, Run, Scene, box

radius = 0.03  # m
heated = 0.01  # m: radius of the middle
notch = 0.004  # m
spacing = 0.00125  # m: between nodes
hot = 150.0  # K: how much hotter the middle would be after 40 s
duration = 24.0  # s
room = 293.0  # K

glass = Material(E=70e9, rho=2500, G0=8, micromodulus="constant", alpha=9e-6, T0=room)
run = Run(solver="static", time_step=1.0, duration=duration, every=1)
ramp = ((0.0, room / (room + hot)), (40.0, 1.0))
beside = spacing / 4

scene = (
    Scene(Circle(0, 0, radius), spacing, glass, 3.0, run, medium=Heat(k=1.0, c=800.0))
    .crack([(radius - notch, 0), (radius, 0)])
    .temperature(Circle(0, 0, heated), room + hot, profile=ramp, name="hot")
    .fix(box(-radius, -2 * spacing, -radius + 1.5 * spacing, 2 * spacing), y=None, name="stand")
    .fix(box(-radius, 0, -radius + 1.5 * spacing, spacing), x=None, name="turn")
)
