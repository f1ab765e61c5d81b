"""A crack runs through a brittle matrix to a stiff fibre, whose surface is weak (dynamic).

Source: a crack that meets an interface at 90 degrees turns into it if its toughness is less than 0.26 of that behind it
(M.-Y. He, J. W. Hutchinson, Int. J. Solids Struct. 25 (1989) 1053-1067); here the fibre is stiffer and tougher.
Calibrated: nothing. Bonds have nu = 1/3.
"""

from pdmesh import Circle, Material, Run, Scene, box

spacing = 5e-4  # m: between nodes
horizon = 3.0  # horizon over spacing
radius = 5e-3  # m: of the fibre
weak = 0.1  # toughness of the fibre's surface over that of the matrix
speed = 0.5  # m/s: of the upper and the lower edge
duration = 60e-6  # s
length, height = 0.04, 0.03  # m

matrix = Material(E=3.5e9, rho=1200, G0=100, law="brittle")
fibre = Material(E=35e9, rho=2500, G0=1000)
middle = height / 2 + spacing / 2

scene = (
    Scene(box(0, 0, length, height), spacing, matrix, horizon, Run(duration=duration, every=50))
    .crack([(0, middle), (0.008, middle)])
    .region(Circle(length / 2, middle, radius), fibre, "fibre")
    .interface(("fibre", "rest"), G0=weak * matrix.G0, name="surface")
    .move("top", velocity=(None, speed), rows=3)
    .move("bottom", velocity=(None, -speed), rows=3)
)
