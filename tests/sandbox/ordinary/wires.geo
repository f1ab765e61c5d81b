SetFactory("OpenCASCADE");
Circle(1) = {0, 0, 0, 1}; Circle(2) = {0, 0, 1, 0.5, 0, 2*Pi}; Wire(1) = {1}; Curve Loop(2) = {2};
ThruSections(1) = {1, 2};
Point(10) = {0, 0, 0}; Point(11) = {0, 0, 3}; Point(12) = {1, 0, 4}; Line(10) = {10, 11};
Spline(11) = {11, 12, 10}; Plane Surface(20) = {2};
m() = Mass Surface{20}; c() = CenterOfMass Surface{20}; Point(13) = {m(0), c(0), c(1)};
Affine {1, 0, 0, 2,  0, 1, 0, 0,  0, 0, 1, 0} { Point{13}; }
Geometry.OCCFixSmallEdges = 1;
