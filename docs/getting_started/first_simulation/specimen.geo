// A compact-tension specimen of PMMA: two pins pull it open, slowly. Lengths in millimetres, x from the line of the pins.
SetFactory("OpenCASCADE");

DefineConstant[
  unit = {"mm", Name "Peridynamics/Units"},
  width = {50, Name "Peridynamics/Plate/Width", Units "mm", Help "From the line of the pins to the back"},
  slit = {25, Name "Peridynamics/Plate/Slit", Units "mm", Help "From the line of the pins to the end of the slit"},

  plate = {1, Name "Peridynamics/Zones/plate/Spacing", Units "mm"},
  way = {0.5, Name "Peridynamics/Zones/way/Spacing", Units "mm", Help "Along the way of the crack"},
  pins = {0.5, Name "Peridynamics/Zones/pins/Spacing", Units "mm"},
  m = {4, Name "Peridynamics/Horizon ratio"},

  E = {3e9, Name "Peridynamics/Material/E", Units "Pa"},
  rho = {1190, Name "Peridynamics/Material/rho", Units "kg/m^3"},
  G0 = {350, Name "Peridynamics/Material/G0", Units "J/m^2"},
  plane = {"strain", Name "Peridynamics/Material/Plane"},
  steel = {200e9, Name "Peridynamics/Materials/steel/E", Units "Pa"},
  tough = {1e5, Name "Peridynamics/Materials/steel/G0", Units "J/m^2", Help "The pins do not break"},

  up = {0.3, Name "Peridynamics/Fixes/upper pin/Displacement y", Units "mm"},
  down = {-0.3, Name "Peridynamics/Fixes/lower pin/Displacement y", Units "mm"},
  upper = {"-0.1 13.65 0.1 13.85", Name "Peridynamics/Fixes/upper pin/Box", Units "mm", Help "The node in its middle"},
  lower = {"-0.1 -13.85 0.1 -13.65", Name "Peridynamics/Fixes/lower pin/Box", Units "mm"},
  slowly = {"ramp 36", Name "Peridynamics/Fixes/upper pin/Profile", Help "1 mm a minute"},
  too = {"ramp 36", Name "Peridynamics/Fixes/lower pin/Profile"},

  solver = {"static", Name "Peridynamics/Run/Solver"},
  steps = {24, Name "Peridynamics/Run/Load steps"}
];

Rectangle(1) = {-12.5, -29.75, 0, 62.5, 59.5};
Rectangle(2) = {slit - 5, -4, 0, width - slit + 5, 8};
Disk(3) = {0, 13.75, 0, 7};     Disk(4) = {0, -13.75, 0, 7};
Disk(5) = {0, 13.75, 0, 6.25};  Disk(6) = {0, -13.75, 0, 6.25};
Point(101) = {-12.5, 0, 0};     Point(102) = {slit, 0, 0};  Line(101) = {101, 102};

Physical Surface("zone:plate") = {1};
Physical Surface("zone:way") = {2};
Physical Surface("zone:pins") = {3, 4};
Physical Surface("material:steel") = {5, 6};
Physical Curve("crack:slit") = {101};
