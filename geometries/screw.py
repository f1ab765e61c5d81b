"""A screw of magnesium dissolves in a sphere of liquid whose surface is kept clean.

Source: the corrosion example of A. Ongaro, A. Shojaei, F. Mossaiby, A. Hermann, C. J. Cyron, P. Trovalusci, Int. J.
Fract. (2023), doi 10.1007/s10704-023-00709-8: a screw of radius 1 mm and height 4 mm with a slot in a sphere of 6 mm.
C_solid is magnesium's density over its molar mass.
Calibrated: the slot and the other numbers, which the source does not give. Of them C_sat over C_solid alone decides
what is dissolved after so many radius^2 / D; half of the screw is after 0.51 of them.
"""

from pdmesh import Body, Box, Cylinder, Medium, Run, Sphere

spacing = 2.5e-4  # m: between nodes
radius = 1e-3  # m: of the screw
height = 4e-3  # m
slot = 5e-4  # m: its width and its depth
liquid = 6e-3  # m: radius from which on the liquid is clean
D = 1e-9  # m^2/s
C_solid = 71600.0  # mol/m^3
C_sat = 14320.0  # mol/m^3
duration = 2000.0  # s
steps = 80
every = 8  # steps between two frames

far = (int(liquid / spacing) + 4) * spacing
origin = (0.0, 0.0, 0.0)
whole = Cylinder((0, 0, -height / 2), (0, 0, height / 2), radius)
cut = Box((-2 * radius, -slot / 2, height / 2 - slot), (2 * radius, slot / 2, height))

scene = (
    Body(
        Sphere(origin, far),
        spacing,
        medium=Medium(D=D, C_solid=C_solid, C_sat=C_sat),
        run=Run(time_step=duration / steps, steps=steps, every=every),
    )
    .dissolve(whole - cut, "screw")
    .hold(Sphere(origin, far + spacing) - Sphere(origin, liquid), 0.0, name="clean")
)
