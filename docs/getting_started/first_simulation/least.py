from pdmesh import Material, Run, Scene, box

scene = (
    Scene(box(0, 0, 0.1, 0.04), 1e-3, Material(E=65e9, rho=2235, G0=204), run=Run(duration=40e-6))
    .crack([(0, 0.02), (0.05, 0.02)])
    .load("top", traction=(0, 12e6))
    .load("bottom", traction=(0, -12e6))
)
