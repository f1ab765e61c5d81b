// A bracket with four holes, a re-entrant corner, a V-notch and a kinked crack: any plate can be drawn.
//
// Source: in the spirit of figure 18 of A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione
// di tecniche di grid generation e refinement nell'analisi peridinamica 2D" (4796 nodes; the figure itself is lost).
// Calibrated: everything; the shape, the zones and the load are free inventions around that number of nodes.
// Drawn with the OpenCASCADE kernel. The zone is grown by the coarse horizon, so that no coarse node sees it.
// All lengths in metres, SI units throughout. Open it in Gmsh to edit the parameters.

SetFactory("OpenCASCADE");

DefineConstant[
  kink = {30, Min -80, Max 80, Name "Peridynamics/Plate/Kink", Units "degree", Help "Angle between the two legs of the crack"},
  hole = {0.008, Min 1e-3, Max 0.012, Name "Peridynamics/Plate/Hole radius", Units "m", Help "Radius of the large hole"},

  coarse = {1.6e-3, Min 1e-5, Name "Peridynamics/Zones/plate/Spacing", Units "m", Help "Node spacing of the plate"},
  fine = {0.8e-3, Min 1e-5, Name "Peridynamics/Zones/corner/Spacing", Units "m", Help "Node spacing around the corner and the crack"},
  around = {1e-3, Min 0, Name "Peridynamics/Refine/hole/Distance", Units "m", Help "Nodes nearer to a hole than this are as fine as its spacing"},
  ring = {0.8e-3, Min 1e-5, Name "Peridynamics/Refine/hole/Spacing", Units "m", Help "Node spacing around the holes"},

  pull = {10e6, Name "Peridynamics/Loads/arm/Traction x", Units "Pa", Help "Traction on the end of the arm"},
  rows = {3, Min 1, Step 1, Name "Peridynamics/Loads/arm/Rows", Help "Columns of nodes that carry it"},
  growth = {"ramp 5e-6", Name "Peridynamics/Loads/arm/Profile", Help "How it follows time"},
  foot = {"xy", Choices{"xy", "x", "y"}, Name "Peridynamics/Fixes/foot/Components", Help "Components held at the foot"},

  E = {72e9, Min 0, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {2440, Min 0, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "Density"},
  G0 = {135, Min 0, Name "Peridynamics/Material/G0", Units "J/m^2", Help "Fracture energy"},
  m = {3, Min 2, Max 12, Name "Peridynamics/Horizon ratio", Help "Horizon of a node over its spacing"},
  step = {50e-9, Min 0, Name "Peridynamics/Run/Time step", Units "s", Help "Time step"},
  duration = {50e-6, Min 0, Name "Peridynamics/Run/Duration", Units "s", Help "Time to solve"}
];

// An L of 120 x 90 mm with arms 45 mm wide, less a V-notch, two round holes, an ellipse and a slot
Rectangle(1) = {0, 0, 0, 0.045, 0.09};
Rectangle(2) = {0, 0.045, 0, 0.12, 0.045};
Point(101) = {0.078, 0.09, 0};  Point(102) = {0.086, 0.078, 0};  Point(103) = {0.094, 0.09, 0};
Line(101) = {101, 102};  Line(102) = {102, 103};  Line(103) = {103, 101};
Curve Loop(101) = {101, 102, 103};  Plane Surface(101) = {101};
Disk(102) = {0.022, 0.067, 0, hole};
Disk(103) = {0.105, 0.063, 0, 0.005};
Disk(104) = {0.022, 0.035, 0, 0.012, 0.005};
Rectangle(105) = {0.052, 0.076, 0, 0.016, 0.006, 0.0029};
BooleanUnion(10) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
BooleanDifference(11) = { Surface{10}; Delete; }{ Surface{101:105}; Delete; };

// The fine zone around the re-entrant corner, and the kinked crack that starts there
leg = 0.006;
Disk(12) = {0.045, 0.045, 0, leg + 0.002};
corner() = BooleanIntersection{ Surface{12}; Delete; }{ Surface{11}; };
plate() = BooleanDifference{ Surface{11}; Delete; }{ Surface{corner()}; };
BooleanFragments{ Surface{plate()}; Delete; }{ Surface{corner()}; Delete; }

a = 3*Pi/4;
Point(201) = {0.045, 0.045, 0};
Point(202) = {0.045 + leg/2*Cos(a), 0.045 + leg/2*Sin(a), 0};
Point(203) = {0.045 + leg/2*Cos(a) + leg/2*Cos(a - kink*Pi/180), 0.045 + leg/2*Sin(a) + leg/2*Sin(a - kink*Pi/180), 0};
Line(201) = {201, 202};  Line(202) = {202, 203};

Physical Surface("zone:plate") = {plate()};
Physical Surface("zone:corner") = {corner()};
Physical Curve("crack:corner") = {201, 202};
Physical Curve("load:arm") = Curve In BoundingBox{0.119, 0.044, -1, 0.121, 0.091, 1};
Physical Curve("fix:foot") = Curve In BoundingBox{-0.001, -0.001, -1, 0.046, 0.001, 1};
