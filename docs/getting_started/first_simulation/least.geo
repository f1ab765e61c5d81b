SetFactory("OpenCASCADE");

DefineConstant[
  fine = {1e-3, Name "Peridynamics/Zones/plate/Spacing"},
  E = {65e9, Name "Peridynamics/Material/E"},
  rho = {2235, Name "Peridynamics/Material/rho"},
  G0 = {204, Name "Peridynamics/Material/G0"},
  up = {12e6, Name "Peridynamics/Loads/top/Traction y"},
  down = {-12e6, Name "Peridynamics/Loads/bottom/Traction y"},
  duration = {40e-6, Name "Peridynamics/Run/Duration"}
];

Rectangle(1) = {0, 0, 0, 0.1, 0.04};
Point(10) = {0, 0.02, 0};  Point(11) = {0.05, 0.02, 0};  Line(10) = {10, 11};

Physical Surface("zone:plate") = {1};
Physical Curve("crack:slit") = {10};
Physical Curve("load:bottom") = {1};
Physical Curve("load:top") = {3};
