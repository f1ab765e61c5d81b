// A block of glass with a penny-shaped crack in its middle is pulled suddenly. The crack runs to the sides.
//
// Source: the shape is that of I. N. Sneddon, Proc. R. Soc. Lond. A 187 (1946) 229-260; the glass is that of duran50.geo.
// 27 000 nodes 1 mm apart; the crack has a radius of 4 mm.
// Calibrated: nothing.
// All lengths in metres, SI units throughout.

SetFactory("OpenCASCADE");

DefineConstant[
  side = {0.03, Name "Peridynamics/Plate/Side", Units "m", Help "Edge length of the block"},
  radius = {4e-3, Name "Peridynamics/Plate/Crack radius", Units "m", Help "Radius of the crack"},
  spacing = {1e-3, Name "Peridynamics/Zones/glass/Spacing", Units "m", Help "between nodes"},
  horizon = {3, Name "Peridynamics/Horizon ratio", Help "horizon over spacing"},
  E = {65e9, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {2235, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "density"},
  G0 = {204, Name "Peridynamics/Material/G0", Units "J/m^2", Help "fracture energy"},
  micro = {"constant", Name "Peridynamics/Material/Micromodulus", Help "profile of the bonds' stiffness"},
  top = {30e6, Name "Peridynamics/Loads/top/Traction z", Units "Pa", Help "pull on the upper face"},
  bottom = {-30e6, Name "Peridynamics/Loads/bottom/Traction z", Units "Pa", Help "pull on the lower face"},
  step = {0.2e-6, Name "Peridynamics/Run/Time step", Units "s", Help "of the run"},
  duration = {20e-6, Name "Peridynamics/Run/Duration", Units "s", Help "of the run"},
  every = {10, Name "Peridynamics/Run/Frame every", Help "steps between frames"}
];

Box(1) = {-side / 2, -side / 2, -side / 2, side, side, side};
Disk(100) = {0, 0, 0, radius};

Physical Volume("zone:glass") = {1};
Physical Surface("crack:penny") = {100};
Physical Surface("load:bottom") = {5};
Physical Surface("load:top") = {6};
