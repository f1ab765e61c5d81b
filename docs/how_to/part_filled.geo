// A model of part.step, 100 x 50 mm. Put a value in place of each FILL_IN, then
//   pdmesh build part.geo
//   pdsolve part.json
// part_numbers.png shows the numbers of the edges. Lengths are in mm, all else in SI units.

SetFactory("OpenCASCADE");
Geometry.OCCTargetUnit = "MM";
Merge "part.step";

// 1. The grid: at least three spacings across the thinnest place
DefineConstant[
  unit = {"mm", Name "Peridynamics/Units"},
  spacing = {1, Name "Peridynamics/Zones/part/Spacing", Help "gives about 5000 nodes"}
];
Physical Surface("zone:part") = {Surface{:}};

// 2. The material; for example 65e9, 2235 and 204 of Duran 50 glass
DefineConstant[
  E = {65e9, Name "Peridynamics/Material/E", Units "Pa", Help "Young's modulus"},
  rho = {2235, Name "Peridynamics/Material/rho", Units "kg/m^3", Help "density"},
  G0 = {204, Name "Peridynamics/Material/G0", Units "J/m^2", Help "critical energy release rate"}
];

// 3. Boundary conditions: numbers of edges, with commas between them
Physical Curve("fix:support") = {4};  // does not move
Physical Curve("load:pull") = {2};  // carries the force
DefineConstant[
  force_x = {5e4, Name "Peridynamics/Loads/pull/Force x", Units "N/m", Help "in total"},
  force_y = {0, Name "Peridynamics/Loads/pull/Force y", Units "N/m", Help "in total"},
  growth = {"ramp 1", Name "Peridynamics/Loads/pull/Profile", Help "from 0 to the whole force in 1 s"}
];
// With a displacement in place of the force, a crack grows step by step:
//   Physical Curve("fix:pull") = {1};
//   DefineConstant[ shift = {0.1, Name "Peridynamics/Fixes/pull/Displacement x", Units "mm"} ];

// 4. The analysis: static for slow loads; explicit, with Run/Duration in s, for impact and fast cracks
DefineConstant[
  solver = {"static", Name "Peridynamics/Run/Solver"},
  steps = {10, Name "Peridynamics/Run/Load steps"}
];

// The edges:
//      1  line                   100 mm, from (0, 0) to (100, 0)
//      2  line                    50 mm, from (100, 0) to (100, 50)
//      3  line                   100 mm, from (100, 50) to (0, 50)
//      4  line                    50 mm, from (0, 50) to (0, 0)
