"""Kalthoff and Winkler's experiment with the projectile as a second body, which is free to bounce back.

Source: J. F. Kalthoff, S. Winkler, "Failure mode transition at high rates of shear loading", Impact Loading and Dynamic
Behavior of Materials 1 (1988) 185-195; A. De Checchi, thesis, Padua 2013, figure 77. A maraging steel plate of 100 x
200 mm with two notches of 50 mm; a projectile of the same steel, 100 x 50 mm, hits the edge between them at 33 m/s.
Brittle, plane strain, without friction.
Calibrated: nothing. The notches are cuts without width, the projectile is as wide as the plate between them.
"""

from pdmesh import Material, Run, Scene, box

spacing = 1e-3  # m: between nodes
horizon = 4.0  # horizon over spacing
speed = 33.0  # m/s: of the projectile
duration = 86e-6  # s
frames = 20  # that are written

E, rho = 191e9, 8000.0
steel = Material(E=E, rho=rho, G0=42408, micromodulus="conical", plane="strain")
longest = 0.8 * spacing * (rho / E) ** 0.5  # a little less than what the solver finds
steps = round(duration / longest)
low, high = 0.075, 0.125

scene = (
    Scene(
        box(0, 0, 0.1, 0.2),
        spacing,
        steel,
        horizon,
        Run(time_step=longest, steps=steps, every=max(1, steps // frames), ledger=max(1, steps // 200)),
    )
    .crack([(0, low), (0.05, low)])
    .crack([(0, high), (0.05, high)])
    .body(box(-0.1, low, 0, high), "projectile", velocity=(speed, 0.0))
)
