SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, 1, -Pi/2, Pi/2, Pi}; Box(2) = {2, 0, 0, 1, 1, 1}; Cylinder(3) = {4, 0, 0, 0, 0, 1, 0.5, Pi};
Cone(4) = {6, 0, 0, 1, 0, 0, 0.5, 0.1}; Torus(5) = {10, 0, 0, 1, 0.2}; Wedge(6) = {12, 0, 0, 1, 1, 1, 0.4};
e() = Abs(Boundary{ Surface{ Abs(Boundary{ Volume{2}; }) }; }); f() = Fillet{2}{e(0)}{0.1};
Physical Volume("v") = {1:6};
