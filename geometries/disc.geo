// A disc of magnesium dissolves in a liquid, at whose edge the concentration is 0: a corroding screw in 2D.
//
// Source: the corrosion example of A. Ongaro, A. Shojaei, F. Mossaiby, A. Hermann, C. J. Cyron, P. Trovalusci, Int. J.
// Fract. (2023), doi 10.1007/s10704-023-00709-8, in the plane. C solid is magnesium's density over its molar mass.
// Calibrated: the other numbers, which the source does not give. The share dissolved after a number of radius^2 / D
// depends on C sat over C solid alone.
// All lengths in millimetres, all other quantities in SI units.

DefineConstant[
  radius = {1, Min 0.01, Name "Peridynamics/Plate/Radius", Units "mm", Help "Radius of the disc"},
  liquid = {3, Min 0.01, Name "Peridynamics/Plate/Liquid", Units "mm", Help "Radius from which on the liquid is clean"},

  spacing = {0.05, Min 0.001, Name "Peridynamics/Zones/liquid/Spacing", Units "mm", Help "Node spacing"},
  clean = {0, Min 0, Name "Peridynamics/Holds/clean/Concentration", Units "mol/m^3", Help "Concentration of clean liquid"},

  D = {1e-9, Min 0, Name "Peridynamics/Medium/D", Units "m^2/s", Help "Diffusivity"},
  C_solid = {71600, Min 0, Name "Peridynamics/Medium/C solid", Units "mol/m^3", Help "Content of the solid"},
  C_sat = {14320, Min 0, Name "Peridynamics/Medium/C sat", Units "mol/m^3", Help "What the liquid can hold"},
  dissolution = {"enthalpy", Choices{"enthalpy", "kinetic"}, Name "Peridynamics/Medium/Dissolution", Help "What decides how fast"},
  k_diss = {1, Min 0, Name "Peridynamics/Medium/k diss", Help "Kinetic: ease of links from solid to liquid"},

  m = {3, Min 2, Max 12, Name "Peridynamics/Horizon ratio", Help "Horizon of a node over its spacing"},
  unit = {"mm", Name "Peridynamics/Units", Help "Unit of all lengths here"},
  step = {1, Min 0, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {2500, Min 0, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"},
  every = {50, Min 1, Step 1, Name "Peridynamics/Run/Frame every", Help "Steps between two frames"}
];

// Half a spacing more, so that no node is in the middle
outer = (Ceil(liquid / spacing) + m + 1.5) * spacing;

Point(1) = {0, 0, 0};
For ring In {1 : 3}
  r = (ring == 1) ? radius : ((ring == 2) ? liquid : outer);
  p = 10 * ring;
  Point(p) = {r, 0, 0};  Point(p + 1) = {0, r, 0};  Point(p + 2) = {-r, 0, 0};  Point(p + 3) = {0, -r, 0};
  Circle(p) = {p, 1, p + 1};  Circle(p + 1) = {p + 1, 1, p + 2};
  Circle(p + 2) = {p + 2, 1, p + 3};  Circle(p + 3) = {p + 3, 1, p};
  Curve Loop(ring) = {p, p + 1, p + 2, p + 3};
EndFor
Plane Surface(1) = {1};
Plane Surface(2) = {2, 1};
Plane Surface(3) = {3, 2};

Physical Surface("zone:liquid") = {1, 2, 3};
Physical Surface("hold:clean") = {3};
Physical Surface("solid:disc") = {1};
