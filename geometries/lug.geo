// A lug of PMMA is read from a STEP file in mm. The surface of its hole is moved, and the lug tears behind it.
//
// Source: none, an example of a part that was drawn elsewhere; the PMMA is that of slanted_notch.py.
// 4236 nodes 1 mm apart; the lug is 40 mm long, 20 mm wide and 6 mm thick, its hole 8 mm wide.
// Calibrated: the speed of the hole, so that the lug tears within a fifth of a millisecond.
// Lengths in mm, all else in SI units.

SetFactory("OpenCASCADE");

DefineConstant[
  units = {"mm", Name "Peridynamics/Units"},
  spacing = {1, Name "Peridynamics/Zones/lug/Spacing", Units "mm", Help "between nodes"},
  horizon = {3, Name "Peridynamics/Horizon ratio", Help "horizon over spacing"},
  E = {2.8e9, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {1180, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "density"},
  G0 = {400, Name "Peridynamics/Material/G0", Units "J/m^2", Help "fracture energy"},
  micro = {"constant", Name "Peridynamics/Material/Micromodulus", Help "profile of the bonds' stiffness"},
  hole = {"nearest 26,10,3", Name "Peridynamics/Moves/pin/Face", Help "the surface that is moved"},
  speed = {2, Name "Peridynamics/Moves/pin/Velocity x", Units "m/s", Help "of the hole's surface"},
  ramp = {"ramp 5e-5", Name "Peridynamics/Moves/pin/Profile", Help "of the speed over time"},
  foot = {"left", Name "Peridynamics/Fixes/foot/Face", Help "the face that is held"},
  duration = {2e-4, Name "Peridynamics/Run/Duration", Units "s", Help "of the run"},
  every = {20, Name "Peridynamics/Run/Frame every", Help "steps between frames"}
];

lug() = ShapeFromFile("lug.step");
Physical Volume("zone:lug") = lug();
