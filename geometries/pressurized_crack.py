"""A crack under pressure in the middle of a plate: its stress intensity and its opening are known (quasi-static).

Source: I. N. Sneddon, Proc. R. Soc. Lond. A 187 (1946) 229-260: K = p sqrt(pi a) and an opening of 4 p a / E' in the
middle of a crack in an infinite plate. C. E. Feddersen's sqrt(sec(pi a / W)) of a width W makes K 1.7 % larger here.
Two scales: half of the crack is twenty fine spacings long, and the plate is six times as wide, and twelve times as
high, as the whole crack.
Calibrated: nothing.
"""

from pdmesh import Material, Run, Scene, Static, box

half = 0.01  # m: half the length of the crack
fine = 5e-4  # m: between nodes around the crack
coarse = 2e-3  # m: between the others
pressure = 10e6  # Pa
horizon = 3.0  # horizon over spacing

glass = Material(E=70e9, rho=2500, G0=1e4)  # it bears the pressure
run = Run(solver="static", static=Static(load_steps=1, floating=True))

scene = (
    Scene(box(-6 * half, -12 * half, 6 * half, 12 * half), coarse, glass, horizon, run)
    .zone(box(-1.8 * half, -1.8 * half, 1.8 * half, 1.8 * half), fine, "around the crack")
    .crack([(-half, 0), (half, 0)], "slit")
    .load("crack slit", pressure=pressure)
)
