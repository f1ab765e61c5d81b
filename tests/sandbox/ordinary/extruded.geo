Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Point(3) = {1, 1, 0, 1}; Point(4) = {0, 1, 0, 1};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
out[] = Extrude {0, 0, 0.1} { Surface{1}; Layers{{8, 2}, {0.5, 1}}; Recombine; };
Physical Volume(100) = {out[1]};
angle = 90;
Extrude {{0, 1, 0}, {-1, 0, 0}, -Pi/2} { Surface{1}; Layers{7}; }
Extrude {{-2, 0, 0}, {1, 0, 0}, {0, 0.15, 0.25}, angle * Pi/180} { Point{2}; Layers{10}; }
