"""The K field of a tip that moves at a constant speed is prescribed on the rim of a plate; a crack follows.

Source: M. Z. Hossain, C.-J. Hsueh, B. Bourdin and K. Bhattacharya, J. Mech. Phys. Solids 71 (2014) 15-32 ("surfing"):
the boundary moves as around a tip with K1 = sqrt(E' G0), and the energy release rate of the crack is then G0.
Calibrated: the strength, so that cohesive bonds soften over a few spacings: brittle ones would break at more than G0.
The damping, so that each broken bond's waves fade within the plate.
"""

from math import sqrt

from pdmesh import Material, Run, Scene, box, k_field, ramp

half = 0.02  # m: half the side of the plate
spacing = 1e-3  # m: between nodes
begin, end = -0.008, 0.003  # m: of the moving tip, where the crack ends and where the run does
speed = 75.0  # m/s: of the tip, 2.5 % of the Rayleigh wave speed
rise = 2e-5  # s: in which the field grows, with the tip behind the crack's
E, G0 = 65e9, 204.0  # Pa, J/m^2
horizon = 3.0  # horizon over spacing

depth = horizon * spacing
y = spacing / 2  # m: of the crack, between rows of nodes
duration = rise + (end - begin + depth) / speed
times = [duration * k / 60 for k in range(61)]
glass = Material(E=E, rho=2235, G0=G0, law="cohesive", f_t=57e6)
square = box(-half, -half, half, half)
rim = square.difference(box(-half + depth, -half + depth, half - depth, half - depth))
moving = k_field(glass, sqrt(E * G0), tip=(begin - speed * rise, y), speed=speed, times=times, profile=ramp(rise))

scene = (
    Scene(square, spacing, glass, horizon, Run(duration=duration, damping=3e4))
    .crack([(-half, y), (begin, y)])
    .fix(rim, *moving, name="rim", breakable=True)
)
