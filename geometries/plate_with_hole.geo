// A plate with a round hole under a suddenly applied tension: cracks start at the sides of the hole and split it.
//
// Source: A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione di tecniche di grid
// generation e refinement nell'analisi peridinamica 2D".
// Two scales: 6288 nodes, 0.5 mm between y = 10 and 40 mm and 1 mm outside.
// Calibrated: the tension (22 MPa), which the thesis leaves out.
// All lengths in metres, SI units throughout. Open it in Gmsh to edit the parameters.

DefineConstant[
  width = {0.05, Min 1e-3, Name "Peridynamics/Plate/Width", Units "m", Help "Length of the plate along x"},
  height = {0.05, Min 1e-3, Name "Peridynamics/Plate/Height", Units "m", Help "Length of the plate along y"},
  radius = {0.008, Min 1e-4, Name "Peridynamics/Plate/Radius", Units "m", Help "Radius of the hole"},
  band = {0.03, Min 1e-3, Name "Peridynamics/Plate/Fine band", Units "m", Help "Height of the fine zone around the hole"},

  fine = {0.5e-3, Min 1e-5, Name "Peridynamics/Zones/fine/Spacing", Units "m", Help "Node spacing around the hole"},
  coarse = {1e-3, Min 1e-5, Name "Peridynamics/Zones/coarse/Spacing", Units "m", Help "Node spacing outside"},
  grown = {0, Choices{0, 1}, Name "Peridynamics/Zones/fine/Grown", Help "Grow the fine zone by the coarse horizon (0: as in the thesis)"},

  pull_top = {22e6, Name "Peridynamics/Loads/top/Traction y", Units "Pa", Help "Traction on the upper edge (calibrated)"},
  rows_top = {4, Min 1, Step 1, Name "Peridynamics/Loads/top/Rows", Help "Rows of nodes that carry it"},
  pull_bottom = {-22e6, Name "Peridynamics/Loads/bottom/Traction y", Units "Pa", Help "Traction on the lower edge (calibrated)"},
  rows_bottom = {4, Min 1, Step 1, Name "Peridynamics/Loads/bottom/Rows", Help "Rows of nodes that carry it"},

  E = {71.4e9, Min 0, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {2700, Min 0, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "Density"},
  G0 = {1000, Min 0, Name "Peridynamics/Material/G0", Units "J/m^2", Help "Fracture energy"},
  law = {"bilinear", Choices{"brittle", "bilinear"}, Name "Peridynamics/Material/Force law", Help "Force of a bond against its stretch"},
  kr = {4.154, Min 1, Name "Peridynamics/Material/kr", Help "Stretch at which a bond breaks over that of its greatest force"},
  keep = {0, Choices{0, 1}, Name "Peridynamics/Material/Keep G0", Help "Spend G0 on a crack (0: G0 / kr, as in the thesis)"},
  micromodulus = {"conical", Choices{"conical", "constant"}, Name "Peridynamics/Material/Micromodulus", Help "Stiffness of a bond against its length"},

  m = {4, Min 2, Max 12, Name "Peridynamics/Horizon ratio", Help "Horizon of a node over its spacing"},
  step = {50e-9, Min 0, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {37.5e-6, Min 0, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"},
  every = {25, Min 1, Step 1, Name "Peridynamics/Run/Frame every", Help "Steps between two frames"}
];

low = (height - band)/2;  high = (height + band)/2;  x = width/2;  y = height/2;

Point(1) = {0, 0, 0};      Point(2) = {width, 0, 0};
Point(3) = {0, low, 0};    Point(4) = {width, low, 0};
Point(5) = {0, high, 0};   Point(6) = {width, high, 0};
Point(7) = {0, height, 0}; Point(8) = {width, height, 0};
Point(9) = {x, y, 0};
Point(10) = {x + radius, y, 0};  Point(11) = {x, y + radius, 0};
Point(12) = {x - radius, y, 0};  Point(13) = {x, y - radius, 0};

Line(1) = {1, 2};  Line(2) = {2, 4};  Line(3) = {4, 3};  Line(4) = {3, 1};
Line(5) = {4, 6};  Line(6) = {6, 5};  Line(7) = {5, 3};
Line(8) = {6, 8};  Line(9) = {8, 7};  Line(10) = {7, 5};
Circle(11) = {10, 9, 11};  Circle(12) = {11, 9, 12};  Circle(13) = {12, 9, 13};  Circle(14) = {13, 9, 10};

Curve Loop(1) = {1, 2, 3, 4};      Plane Surface(1) = {1};
Curve Loop(2) = {-3, 5, 6, 7};
Curve Loop(3) = {11, 12, 13, 14};  Plane Surface(2) = {2, 3};
Curve Loop(4) = {-6, 8, 9, 10};    Plane Surface(3) = {4};

Physical Surface("zone:fine") = {2};
Physical Surface("zone:coarse") = {1, 3};
Physical Curve("load:top") = {9};
Physical Curve("load:bottom") = {1};
