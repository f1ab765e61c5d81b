// A magnesium screw in the liquid that dissolves it: fine nodes in a cylinder around it, coarse ones in the ball outside.
//
// Source: sizes of screw, cylinder and ball as in the second example (corrosion of Mg-10Gd) of the paper on multi-adaptive
// spatial discretization of bond-based peridynamics; the slot is not stated there.
// Calibrated: nothing. The slot is as wide and as deep as half the radius.
// All lengths in metres, SI units throughout.

SetFactory("OpenCASCADE");

DefineConstant[
  radius = {1e-3, Name "Peridynamics/Plate/Radius", Units "m", Help "of the screw"},
  height = {4e-3, Name "Peridynamics/Plate/Height", Units "m", Help "of the screw"},
  slot = {0.5e-3, Name "Peridynamics/Plate/Slot", Units "m", Help "its width and its depth, in the upper end"},
  ball = {6e-3, Name "Peridynamics/Plate/Ball", Units "m", Help "radius of the liquid"},
  near = {0.25e-3, Name "Peridynamics/Zones/near/Spacing", Units "m", Help "between nodes in the cylinder"},
  far = {0.5e-3, Name "Peridynamics/Zones/far/Spacing", Units "m", Help "between nodes outside"},
  grown = {0, Name "Peridynamics/Zones/near/Grown", Help "1: fine nodes as far as coarse ones see the cylinder"},
  E = {45e9, Name "Peridynamics/Materials/screw/E", Units "Pa", Help "Young's modulus of magnesium"},
  rho = {1740, Name "Peridynamics/Materials/screw/rho", Units "kg/m^3", Help "its density"},
  G0 = {1e4, Name "Peridynamics/Materials/screw/G0", Units "J/m^2", Help "its fracture energy"}
];

Sphere(1) = {0, 0, 0, ball};
Cylinder(2) = {0, 0, -3.1e-3, 0, 0, 6.2e-3, 2.1e-3};
Cylinder(3) = {0, 0, -height / 2, 0, 0, height, radius};
Box(4) = {-2 * radius, -slot / 2, height / 2 - slot, 4 * radius, slot, 2 * slot};
BooleanDifference(5) = { Volume{3}; Delete; }{ Volume{4}; Delete; };

Physical Volume("zone:far") = {1};
Physical Volume("zone:near") = {2};
Physical Volume("material:screw") = {5};
