"""A block of glass with an inclined edge crack is pulled apart fast. The crack branches into three sheets.

Source: none. It is a thick plate like those whose cracks branch, with a crack inclined along its thickness.
20 480 nodes 0.5 mm apart, in space.
Calibrated: the speed of the grips, so that the crack branches in the middle of the block.
"""

from pdmesh import Body, Box, Material, Run, ramp

spacing = 5e-4  # m: between nodes
length, width, height = 0.02, 0.008, 0.016  # m: along x, y and z
crack = 0.006  # m: how far it reaches in from the left
slope = 0.4  # of the crack along y
speed = 2.0  # m/s: of each grip
duration = 3e-5  # s

glass = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
left, tip, side, off = -0.6 * length, crack - length / 2, 0.6 * width, 0.52 * spacing
corners = [(x, y, off + slope * y) for x, y in ((left, -side), (tip, -side), (tip, side), (left, side))]

scene = (
    Body(
        Box((-length / 2, -width / 2, -height / 2), (length / 2, width / 2, height / 2)),
        spacing,
        glass,
        run=Run(duration=duration),
    )
    .crack([[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]])
    .move("top", velocity=(None, None, speed), profile=ramp(2e-6))
    .move("bottom", velocity=(None, None, -speed), profile=ramp(2e-6))
)
