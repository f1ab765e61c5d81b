SetFactory("OpenCASCADE");

DefineConstant[
  unit = {"mm", Name "Peridynamics/Units"},
  spacing = {1, Name "Peridynamics/Zones/plate/Spacing"},
  E = {65e9, Name "Peridynamics/Material/E"},
  rho = {2235, Name "Peridynamics/Material/rho"},
  G0 = {204, Name "Peridynamics/Material/G0"},
  edge = {"top", Name "Peridynamics/Loads/top/Edge"},
  up = {12e6, Name "Peridynamics/Loads/top/Traction y"},
  down = {-12e6, Name "Peridynamics/Loads/bottom/Traction y"},
  duration = {45e-6, Name "Peridynamics/Run/Duration"}
];

Rectangle(1) = {0, 0, 0, 100, 40};
Disk(2) = {75, 27, 0, 5};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Point(101) = {0, 20, 0};  Point(102) = {50, 20, 0};  Line(101) = {101, 102};

Physical Surface("zone:plate") = {3};
Physical Curve("crack:slit") = {101};
Physical Curve("load:bottom") = Curve In BoundingBox{-1, -1, -1, 101, 1, 1};  // x, y, z of two corners
