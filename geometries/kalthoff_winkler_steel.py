"""Kalthoff and Winkler's experiment with the fracture energy of the steel and half of the impactor's speed.

Source: J. F. Kalthoff, S. Winkler, "Failure mode transition at high rates of shear loading", Impact Loading and Dynamic
Behavior of Materials 1 (1988) 185-195. A maraging steel plate of 100 x 200 mm with two notches of 50 mm; the impactor
at 33 m/s, of the same steel, gives the struck edge half of its speed. Brittle, plane strain; all other edges are free.
Calibrated: nothing. The notches are cuts without width. They lie half a spacing outside y = 75 and 125 mm, between rows
of nodes. All edges of the plate carry nodes.
"""

from pdmesh import Material, Run, Scene, box

spacing = 1e-3  # m: between nodes
horizon = 4.0  # horizon over spacing
speed = 16.5  # m/s: of the struck edge, held
duration = 86e-6  # s
step = 0.0  # s: time step; 0: the longest that is surely stable
frames = 20  # that are written
adapt = "none"  # hybrid: peridynamics only where bonds may break

E, rho = 191e9, 8000.0
steel = Material(E=E, rho=rho, G0=42408, micromodulus="conical", plane="strain")
longest = step or 1.2 * spacing * (rho / E) ** 0.5  # a little less than what the solver finds
steps = round(duration / longest)
low, high = 0.075 - spacing / 2, 0.125 + spacing / 2

scene = (
    Scene(
        box(0, 0, 0.1, 0.2),
        spacing,
        steel,
        horizon,
        Run(time_step=longest, steps=steps, every=max(1, steps // frames), adapt=adapt),
    )
    .crack([(0, low), (0.05, low)])
    .crack([(0, high), (0.05, high)])
    .move([(0, low), (0, high)], velocity=(speed, None), rows=1, name="impact")
)
