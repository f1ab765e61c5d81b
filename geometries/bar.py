"""A bar, fixed at its left end, is pulled at its right end from time 0 on (correspondence model, 1111 nodes).

Source: the bar of the correspondence model's source (figures 7.1 to 7.7), which gives no numbers. The reference is the
classical bar: at 1, 2, 3, 4 times L / c its end has moved by 1, 2, 1, 0 times sigma L / E.
Calibrated: the load, a thousandth of E; nu = 0, so that the height of the bar does not matter.
"""

from pdmesh import Material, Run, Scene, box

spacing = 0.01  # m: between nodes
horizon = 3.0  # horizon over spacing
traction = 1e-3  # Pa: on the right end
nu = 0.0

# a unit of everything: E = 1 Pa, rho = 1 kg/m^3, 1 m
unit = Material(E=1, rho=1, G0=1, nu=nu, model="correspondence", failure="none")
run = Run(time_step=0.25 * spacing, steps=round(16 / spacing), every=round(1 / spacing), ledger=round(0.2 / spacing))

scene = (
    Scene(box(0, -0.05, 1, 0.05), spacing, unit, horizon, run)
    .fix("left", x=0, y=None, rows=1, name="held")
    .load("right", traction=(traction, 0), rows=1, name="pulled")
)
