"""A bar whose stiffness waves along it, with random strengths, is pulled at its right end at rest.

Source: exact; sections in series have the harmonic mean, E0 over the mean of exp(-a sin) = I0(a) for the amplitude a.
Calibrated: the wave's length of 8 horizons; `m` of glass, and `V0`, a cube of one horizon.
"""

from math import exp, pi, sin

from pdmesh import Material, Run, Scene, Weibull, box

length, height = 0.096, 0.024  # m
spacing = 1e-3  # m: between nodes
horizon = 3.0  # horizon over spacing
wave = 0.024  # m: length of a wave of the stiffness
amplitude = 0.9  # of its logarithm; 0: a uniform bar
E0 = 65e9  # Pa
strain = 1e-5
m = 8.0  # Weibull's modulus
seed = 1

block = horizon * spacing
glass = Material(E=E0, rho=2235, G0=204)


def stiffness(x, y):
    return E0 * exp(amplitude * sin(2 * pi * x / wave))


scene = (
    Scene(box(0, 0, length, height), spacing, glass, horizon, Run(solver="static"))
    .vary("E", stiffness)
    .vary("G0", Weibull(m, block**2, seed))
    .fix("left", x=0, y=None, name="held")
    .fix("right", x=strain * length, y=None, name="pulled")
    .roller(0, height / 2, along="x")
)
