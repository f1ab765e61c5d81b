// Kalthoff and Winkler's experiment: a plate with two edge notches is struck between them. A crack leaves each
// notch at about 70 degrees to the line of the notch.
//
// Source: A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione di tecniche di grid
// generation e refinement nell'analisi peridinamica 2D"; the experiment is J. F. Kalthoff, S. Winkler, "Failure mode
// transition at high rates of shear loading", Impact Loading and Dynamic Behavior of Materials 1 (1988) 185-195.
// Two scales: 13255 nodes, 1 mm between y = 46 and 154 mm and 2 mm outside.
// Calibrated: G0 (1e4 J/m^2 gives the critical stretches of the thesis's table 6; the steel's is about 2.2e4). The
// struck edge is held at 32 m/s; as a mere initial velocity it breaks nothing.
// All lengths in metres, SI units throughout. Open it in Gmsh to edit the parameters.

DefineConstant[
  width = {0.1, Min 0.01, Name "Peridynamics/Plate/Width", Units "m", Help "Length of the plate along x"},
  height = {0.2, Min 0.01, Name "Peridynamics/Plate/Height", Units "m", Help "Length of the plate along y"},
  notch = {0.05, Min 1e-3, Name "Peridynamics/Plate/Notch length", Units "m", Help "Length of the two notches"},
  apart = {0.049, Min 1e-3, Name "Peridynamics/Plate/Notches apart", Units "m", Help "Distance between the two notches"},
  band = {0.108, Min 1e-3, Name "Peridynamics/Plate/Fine band", Units "m", Help "Height of the fine zone around the notches"},

  fine = {1e-3, Min 1e-5, Name "Peridynamics/Zones/fine/Spacing", Units "m", Help "Node spacing around the notches"},
  coarse = {2e-3, Min 1e-5, Name "Peridynamics/Zones/coarse/Spacing", Units "m", Help "Node spacing outside"},
  grown = {0, Choices{0, 1}, Name "Peridynamics/Zones/fine/Grown", Help "Grow the fine zone by the coarse horizon (0: as in the thesis)"},

  speed = {32, Name "Peridynamics/Moves/impact/Velocity x", Units "m/s", Help "Velocity of the struck edge, held"},
  struck = {1, Min 1, Step 1, Name "Peridynamics/Moves/impact/Rows", Help "Columns of nodes that are struck"},
  held_bottom = {"xy", Choices{"xy", "x", "y"}, Name "Peridynamics/Fixes/bottom/Components", Help "Components held at the lower edge"},
  held_top = {"xy", Choices{"xy", "x", "y"}, Name "Peridynamics/Fixes/top/Components", Help "Components held at the upper edge"},

  E = {191e9, Min 0, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {8000, Min 0, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "Density"},
  G0 = {1e4, Min 0, Name "Peridynamics/Material/G0", Units "J/m^2", Help "Fracture energy (calibrated)"},
  law = {"bilinear", Choices{"brittle", "bilinear"}, Name "Peridynamics/Material/Force law", Help "Force of a bond against its stretch"},
  kr = {1.638, Min 1, Name "Peridynamics/Material/kr", Help "Stretch at which a bond breaks over that of its greatest force"},
  keep = {0, Choices{0, 1}, Name "Peridynamics/Material/Keep G0", Help "Spend G0 on a crack (0: G0 / kr, as in the thesis)"},
  micromodulus = {"conical", Choices{"conical", "constant"}, Name "Peridynamics/Material/Micromodulus", Help "Stiffness of a bond against its length"},

  m = {3, Min 2, Max 12, Name "Peridynamics/Horizon ratio", Help "Horizon of a node over its spacing"},
  step = {100e-9, Min 0, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {50e-6, Min 0, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"},
  every = {25, Min 1, Step 1, Name "Peridynamics/Run/Frame every", Help "Steps between two frames"}
];

low = (height - band)/2;    high = (height + band)/2;
first = (height - apart)/2; second = (height + apart)/2;

Point(1) = {0, 0, 0};       Point(2) = {width, 0, 0};
Point(3) = {0, low, 0};     Point(4) = {width, low, 0};
Point(5) = {0, first, 0};   Point(6) = {notch, first, 0};
Point(7) = {0, second, 0};  Point(8) = {notch, second, 0};
Point(9) = {0, high, 0};    Point(10) = {width, high, 0};
Point(11) = {0, height, 0}; Point(12) = {width, height, 0};

Line(1) = {1, 2};   Line(2) = {2, 4};    Line(3) = {4, 3};   Line(4) = {3, 1};
Line(5) = {4, 10};  Line(6) = {10, 9};   Line(7) = {9, 7};   Line(8) = {7, 5};  Line(9) = {5, 3};
Line(10) = {10, 12}; Line(11) = {12, 11}; Line(12) = {11, 9};
Line(13) = {5, 6};  Line(14) = {7, 8};

Curve Loop(1) = {1, 2, 3, 4};           Plane Surface(1) = {1};
Curve Loop(2) = {-3, 5, 6, 7, 8, 9};    Plane Surface(2) = {2};
Curve Loop(3) = {-6, 10, 11, 12};       Plane Surface(3) = {3};
Curve{13, 14} In Surface{2};

Physical Surface("zone:fine") = {2};
Physical Surface("zone:coarse") = {1, 3};
Physical Curve("crack:lower") = {13};
Physical Curve("crack:upper") = {14};
Physical Curve("move:impact") = {8};
Physical Curve("fix:bottom") = {1};
Physical Curve("fix:top") = {11};
