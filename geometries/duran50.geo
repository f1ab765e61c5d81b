// Pre-cracked plate of Duran 50 glass under a suddenly applied tension of 12 MPa: the crack runs and branches.
//
// Source: A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione di tecniche di grid
// generation e refinement nell'analisi peridinamica 2D", after Y. D. Ha and F. Bobaru, Int. J. Fract. 162 (2010)
// 229-244.
// Two scales: 2732 nodes, 1 mm around the crack and 2 mm outside. The horizon ratio (4) is not stated in the
// thesis; it is the one that gives the critical stretches of its table 4.
// Calibrated: the rows that carry the load (4).
// All lengths in metres, SI units throughout. Open it in Gmsh to edit the parameters.

DefineConstant[
  length = {0.1, Min 0.01, Name "Peridynamics/Plate/Length", Units "m", Help "Length of the plate along x"},
  height = {0.04, Min 0.01, Name "Peridynamics/Plate/Height", Units "m", Help "Height of the plate along y"},
  crack = {0.05, Min 0, Name "Peridynamics/Plate/Crack length", Units "m", Help "Length of the edge crack at half height"},
  band = {0.022, Min 0.001, Name "Peridynamics/Plate/Fine band", Units "m", Help "Height of the fine zone around the crack"},

  fine = {1e-3, Min 1e-5, Name "Peridynamics/Zones/fine/Spacing", Units "m", Help "Node spacing around the crack"},
  coarse = {2e-3, Min 1e-5, Name "Peridynamics/Zones/coarse/Spacing", Units "m", Help "Node spacing outside"},
  grown = {0, Choices{0, 1}, Name "Peridynamics/Zones/fine/Grown", Help "Grow the fine zone by the coarse horizon (0: as in the thesis)"},

  pull_top = {12e6, Name "Peridynamics/Loads/top/Traction y", Units "Pa", Help "Traction on the upper edge"},
  rows_top = {4, Min 1, Step 1, Name "Peridynamics/Loads/top/Rows", Help "Rows of nodes that carry it"},
  pull_bottom = {-12e6, Name "Peridynamics/Loads/bottom/Traction y", Units "Pa", Help "Traction on the lower edge"},
  rows_bottom = {4, Min 1, Step 1, Name "Peridynamics/Loads/bottom/Rows", Help "Rows of nodes that carry it"},

  E = {65e9, Min 0, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {2235, Min 0, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "Density"},
  G0 = {204, Min 0, Name "Peridynamics/Material/G0", Units "J/m^2", Help "Fracture energy"},
  law = {"brittle", Choices{"brittle", "bilinear"}, Name "Peridynamics/Material/Force law", Help "Force of a bond against its stretch"},
  micromodulus = {"conical", Choices{"conical", "constant"}, Name "Peridynamics/Material/Micromodulus", Help "Stiffness of a bond against its length"},

  m = {4, Min 2, Max 12, Name "Peridynamics/Horizon ratio", Help "Horizon of a node over its spacing"},
  step = {25e-9, Min 0, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {42.5e-6, Min 0, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"},
  every = {50, Min 1, Step 1, Name "Peridynamics/Run/Frame every", Help "Steps between two frames"}
];

// The plate, from bottom to top, in three bands
Point(1) = {0, -height/2, 0};       Point(2) = {length, -height/2, 0};
Point(3) = {0, -band/2, 0};         Point(4) = {length, -band/2, 0};
Point(5) = {0, 0, 0};               Point(6) = {crack, 0, 0};
Point(7) = {0, band/2, 0};          Point(8) = {length, band/2, 0};
Point(9) = {0, height/2, 0};        Point(10) = {length, height/2, 0};

Line(1) = {1, 2};   Line(2) = {2, 4};   Line(3) = {4, 3};   Line(4) = {3, 1};
Line(5) = {4, 8};   Line(6) = {8, 7};   Line(7) = {7, 5};   Line(8) = {5, 3};
Line(9) = {8, 10};  Line(10) = {10, 9}; Line(11) = {9, 7};  Line(12) = {5, 6};

Curve Loop(1) = {1, 2, 3, 4};       Plane Surface(1) = {1};
Curve Loop(2) = {-3, 5, 6, 7, 8};   Plane Surface(2) = {2};
Curve Loop(3) = {-6, 9, 10, 11};    Plane Surface(3) = {3};
Curve{12} In Surface{2};

Physical Surface("zone:fine") = {2};
Physical Surface("zone:coarse") = {1, 3};
Physical Curve("crack:notch") = {12};
Physical Curve("load:top") = {10};
Physical Curve("load:bottom") = {1};
