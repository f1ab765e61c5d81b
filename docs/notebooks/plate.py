from pdmesh import Material, Run, Scene, box

spacing = 1e-3  # m: between nodes
traction = 12e6  # Pa: on both long sides

scene = (
    Scene(box(0, -0.02, 0.1, 0.02), spacing, Material(E=65e9, rho=2235, G0=204), run=Run(steps=600, every=600))
    .crack([(0, spacing / 2), (0.05, spacing / 2)])
    .load("top", traction=(0, traction))
    .load("bottom", traction=(0, -traction))
)
