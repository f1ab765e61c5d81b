// A plate with an interior crack at 45 degrees under a suddenly applied tension: the crack turns into the horizontal
// and splits the plate.
//
// Source: A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione di tecniche di grid
// generation e refinement nell'analisi peridinamica 2D".
// Two scales: 4591 nodes, 0.5 mm between y = 15 and 45 mm and 1 mm outside.
// Calibrated: the tension (120 MPa) and the crack's length (14 mm), which the thesis leaves out; the crack's centre is
// a quarter of a millimetre off the plate's, so that the crack runs between nodes.
// All lengths in metres, SI units throughout. Open it in Gmsh to edit the parameters.

DefineConstant[
  width = {0.03, Min 1e-3, Name "Peridynamics/Plate/Width", Units "m", Help "Length of the plate along x"},
  height = {0.06, Min 1e-3, Name "Peridynamics/Plate/Height", Units "m", Help "Length of the plate along y"},
  crack = {0.014, Min 1e-4, Name "Peridynamics/Plate/Crack length", Units "m", Help "Length of the crack (calibrated)"},
  angle = {45, Min -90, Max 90, Name "Peridynamics/Plate/Crack angle", Units "degree", Help "Angle of the crack to x"},
  centre = {0.01525, Name "Peridynamics/Plate/Crack centre", Units "m", Help "Centre of the crack along x"},
  band = {0.03, Min 1e-3, Name "Peridynamics/Plate/Fine band", Units "m", Help "Height of the fine zone around the crack"},

  fine = {0.5e-3, Min 1e-5, Name "Peridynamics/Zones/fine/Spacing", Units "m", Help "Node spacing around the crack"},
  coarse = {1e-3, Min 1e-5, Name "Peridynamics/Zones/coarse/Spacing", Units "m", Help "Node spacing outside"},
  grown = {0, Choices{0, 1}, Name "Peridynamics/Zones/fine/Grown", Help "Grow the fine zone by the coarse horizon (0: as in the thesis)"},

  pull_top = {120e6, Name "Peridynamics/Loads/top/Traction y", Units "Pa", Help "Traction on the upper edge (calibrated)"},
  rows_top = {4, Min 1, Step 1, Name "Peridynamics/Loads/top/Rows", Help "Rows of nodes that carry it"},
  pull_bottom = {-120e6, Name "Peridynamics/Loads/bottom/Traction y", Units "Pa", Help "Traction on the lower edge (calibrated)"},
  rows_bottom = {4, Min 1, Step 1, Name "Peridynamics/Loads/bottom/Rows", Help "Rows of nodes that carry it"},

  E = {200e9, Min 0, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {5000, Min 0, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "Density"},
  G0 = {2170, Min 0, Name "Peridynamics/Material/G0", Units "J/m^2", Help "Fracture energy"},
  law = {"bilinear", Choices{"brittle", "bilinear"}, Name "Peridynamics/Material/Force law", Help "Force of a bond against its stretch"},
  kr = {1.819, Min 1, Name "Peridynamics/Material/kr", Help "Stretch at which a bond breaks over that of its greatest force"},
  keep = {0, Choices{0, 1}, Name "Peridynamics/Material/Keep G0", Help "Spend G0 on a crack (0: G0 / kr, as in the thesis)"},
  micromodulus = {"conical", Choices{"conical", "constant"}, Name "Peridynamics/Material/Micromodulus", Help "Stiffness of a bond against its length"},

  m = {4, Min 2, Max 12, Name "Peridynamics/Horizon ratio", Help "Horizon of a node over its spacing"},
  step = {25e-9, Min 0, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {12.5e-6, Min 0, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"},
  every = {20, Min 1, Step 1, Name "Peridynamics/Run/Frame every", Help "Steps between two frames"}
];

low = (height - band)/2;  high = (height + band)/2;
dx = crack/2 * Cos(angle*Pi/180);  dy = crack/2 * Sin(angle*Pi/180);

Point(1) = {0, 0, 0};      Point(2) = {width, 0, 0};
Point(3) = {0, low, 0};    Point(4) = {width, low, 0};
Point(5) = {0, high, 0};   Point(6) = {width, high, 0};
Point(7) = {0, height, 0}; Point(8) = {width, height, 0};
Point(9) = {centre - dx, height/2 - dy, 0};  Point(10) = {centre + dx, height/2 + dy, 0};

Line(1) = {1, 2};  Line(2) = {2, 4};  Line(3) = {4, 3};  Line(4) = {3, 1};
Line(5) = {4, 6};  Line(6) = {6, 5};  Line(7) = {5, 3};
Line(8) = {6, 8};  Line(9) = {8, 7};  Line(10) = {7, 5};
Line(11) = {9, 10};

Curve Loop(1) = {1, 2, 3, 4};    Plane Surface(1) = {1};
Curve Loop(2) = {-3, 5, 6, 7};   Plane Surface(2) = {2};
Curve Loop(3) = {-6, 8, 9, 10};  Plane Surface(3) = {3};
Curve{11} In Surface{2};

Physical Surface("zone:fine") = {2};
Physical Surface("zone:coarse") = {1, 3};
Physical Curve("crack:oblique") = {11};
Physical Curve("load:top") = {9};
Physical Curve("load:bottom") = {1};
