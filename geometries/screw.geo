// A magnesium screw dissolves in a ball of liquid, at whose surface the concentration is 0. Nodes are fine in a
// cylinder around the screw, and coarse elsewhere.
//
// Source: sizes of screw, cylinder and ball as in the second example (corrosion of Mg-10Gd) of the paper on multi-adaptive
// spatial discretization of bond-based peridynamics; the slot is not stated there.
// Calibrated: all that is not a size. The share dissolved after a number of radius^2 / D depends on C sat over C solid
// alone. The slot is as wide and as deep as half the radius.
// All lengths in metres, SI units throughout.

SetFactory("OpenCASCADE");

DefineConstant[
  radius = {1e-3, Name "Peridynamics/Plate/Radius", Units "m", Help "Radius of the screw"},
  height = {4e-3, Name "Peridynamics/Plate/Height", Units "m", Help "Height of the screw"},
  slot = {0.5e-3, Name "Peridynamics/Plate/Slot", Units "m", Help "its width and its depth, in the upper end"},
  ball = {6e-3, Name "Peridynamics/Plate/Ball", Units "m", Help "radius of the liquid"},
  near = {0.25e-3, Name "Peridynamics/Zones/near/Spacing", Units "m", Help "between nodes in the cylinder"},
  far = {0.5e-3, Name "Peridynamics/Zones/far/Spacing", Units "m", Help "between nodes outside"},
  grown = {0, Name "Peridynamics/Zones/near/Grown", Help "1: fine nodes as far as coarse ones see the cylinder"},
  clean = {0, Name "Peridynamics/Holds/clean/Concentration", Units "mol/m^3", Help "of the liquid from the ball on"},
  D = {1e-9, Name "Peridynamics/Medium/D", Units "m^2/s", Help "diffusivity"},
  C_solid = {71600, Name "Peridynamics/Medium/C solid", Units "mol/m^3", Help "content of magnesium"},
  C_sat = {14320, Name "Peridynamics/Medium/C sat", Units "mol/m^3", Help "what the liquid can hold"},
  step = {25, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {2000, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"},
  every = {8, Name "Peridynamics/Run/Frame every", Help "Steps between two frames"}
];

// Clean liquid as far as links reach into it, in whole cubes of the coarse lattice
outer = (Ceil(ball / far) + 4) * far;
Sphere(1) = {0, 0, 0, outer};
Cylinder(2) = {0, 0, -3.1e-3, 0, 0, 6.2e-3, 2.1e-3};
Cylinder(3) = {0, 0, -height / 2, 0, 0, height, radius};
Box(4) = {-2 * radius, -slot / 2, height / 2 - slot, 4 * radius, slot, 2 * slot};
Sphere(6) = {0, 0, 0, outer + far};
Sphere(7) = {0, 0, 0, ball};
BooleanDifference(8) = { Volume{6}; Delete; }{ Volume{7}; Delete; };
BooleanDifference(5) = { Volume{3}; Delete; }{ Volume{4}; Delete; };

Physical Volume("zone:far") = {1};
Physical Volume("zone:near") = {2};
Physical Volume("solid:screw") = {5};
Physical Volume("hold:clean") = {8};
