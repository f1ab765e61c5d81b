// A glass plate with a V-notch in its upper edge, pulled along x: the crack runs from the notch's root and branches.
//
// Source: A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione di tecniche di grid
// generation e refinement nell'analisi peridinamica 2D".
// Two scales: 8931 nodes, 0.5 mm between x = 15 and 65 mm and 1 mm outside.
// Calibrated: the tension (22 MPa), which the thesis leaves out, and the notch (10 mm deep, 90 degrees).
// All lengths in metres, SI units throughout. Open it in Gmsh to edit the parameters.

DefineConstant[
  width = {0.08, Min 1e-3, Name "Peridynamics/Plate/Width", Units "m", Help "Length of the plate along x"},
  height = {0.04, Min 1e-3, Name "Peridynamics/Plate/Height", Units "m", Help "Length of the plate along y"},
  depth = {0.01, Min 1e-4, Name "Peridynamics/Plate/Notch depth", Units "m", Help "Depth of the notch (calibrated)"},
  opening = {90, Min 1, Max 170, Name "Peridynamics/Plate/Notch angle", Units "degree", Help "Opening of the notch (calibrated)"},
  band = {0.05, Min 1e-3, Name "Peridynamics/Plate/Fine band", Units "m", Help "Width of the fine zone around the notch"},

  fine = {0.5e-3, Min 1e-5, Name "Peridynamics/Zones/fine/Spacing", Units "m", Help "Node spacing around the notch"},
  coarse = {1e-3, Min 1e-5, Name "Peridynamics/Zones/coarse/Spacing", Units "m", Help "Node spacing outside"},
  grown = {0, Choices{0, 1}, Name "Peridynamics/Zones/fine/Grown", Help "Grow the fine zone by the coarse horizon (0: as in the thesis)"},

  pull_right = {22e6, Name "Peridynamics/Loads/right/Traction x", Units "Pa", Help "Traction on the right edge (calibrated)"},
  rows_right = {4, Min 1, Step 1, Name "Peridynamics/Loads/right/Rows", Help "Columns of nodes that carry it"},
  pull_left = {-22e6, Name "Peridynamics/Loads/left/Traction x", Units "Pa", Help "Traction on the left edge (calibrated)"},
  rows_left = {4, Min 1, Step 1, Name "Peridynamics/Loads/left/Rows", Help "Columns of nodes that carry it"},

  E = {65e9, Min 0, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {2235, Min 0, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "Density"},
  G0 = {204, Min 0, Name "Peridynamics/Material/G0", Units "J/m^2", Help "Fracture energy"},
  law = {"brittle", Choices{"brittle", "bilinear"}, Name "Peridynamics/Material/Force law", Help "Force of a bond against its stretch"},
  micromodulus = {"conical", Choices{"conical", "constant"}, Name "Peridynamics/Material/Micromodulus", Help "Stiffness of a bond against its length"},

  m = {3, Min 2, Max 12, Name "Peridynamics/Horizon ratio", Help "Horizon of a node over its spacing"},
  step = {25e-9, Min 0, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {27.5e-6, Min 0, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"},
  every = {50, Min 1, Step 1, Name "Peridynamics/Run/Frame every", Help "Steps between two frames"}
];

left = (width - band)/2;  right = (width + band)/2;  x = width/2;
half = depth * Tan(opening/2 * Pi/180);

Point(1) = {0, 0, 0};              Point(2) = {left, 0, 0};
Point(3) = {right, 0, 0};          Point(4) = {width, 0, 0};
Point(5) = {width, height, 0};     Point(6) = {right, height, 0};
Point(7) = {x + half, height, 0};  Point(8) = {x, height - depth, 0};  Point(9) = {x - half, height, 0};
Point(10) = {left, height, 0};     Point(11) = {0, height, 0};

Line(1) = {1, 2};   Line(2) = {2, 3};   Line(3) = {3, 4};   Line(4) = {4, 5};   Line(5) = {5, 6};
Line(6) = {6, 7};   Line(7) = {7, 8};   Line(8) = {8, 9};   Line(9) = {9, 10};  Line(10) = {10, 11};
Line(11) = {11, 1}; Line(12) = {2, 10}; Line(13) = {3, 6};

Curve Loop(1) = {1, 12, 10, 11};               Plane Surface(1) = {1};
Curve Loop(2) = {2, 13, 6, 7, 8, 9, -12};      Plane Surface(2) = {2};
Curve Loop(3) = {3, 4, 5, -13};                Plane Surface(3) = {3};

Physical Surface("zone:fine") = {2};
Physical Surface("zone:coarse") = {1, 3};
Physical Curve("load:right") = {4};
Physical Curve("load:left") = {11};
