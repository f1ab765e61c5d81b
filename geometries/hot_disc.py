"""A glass disc is heated in the middle. The middle is under compression, the rim under tension (quasi-static).

Source: the free disc of S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., section 150: the hoop stress at
the rim is E alpha times the mean temperature less that of the rim.
Calibrated: all numbers; the glass is a soda-lime glass, and 40 K do not crack it. Hotter middles do, and take minutes.
"""

from pdmesh import Circle, Heat, Material, Run, Scene, box

radius = 0.03  # m
heated = 0.01  # m: radius of the middle
spacing = 0.0015  # m: between nodes
hot = 40.0  # K: how much hotter the middle is in the end
duration = 20.0  # s
room = 293.0  # K

glass = Material(E=70e9, rho=2500, G0=8, micromodulus="constant", alpha=9e-6, T0=room)
run = Run(solver="static", time_step=1.0, duration=duration, every=5)
ramp = ((0.0, room / (room + hot)), (duration, 1.0))

scene = (
    Scene(Circle(0, 0, radius), spacing, glass, 3.0, run, medium=Heat(k=1.0, c=800.0))
    .temperature(Circle(0, 0, heated), room + hot, profile=ramp, name="hot")
    .fix(box(-spacing / 2, -spacing / 2, spacing / 2, spacing / 2), name="middle")
    .fix(box(-heated, -spacing / 2, -heated + spacing, spacing / 2), x=None, name="turn")
)
