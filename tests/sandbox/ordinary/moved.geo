Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Point(3) = {1, 1, 0, 1}; Point(4) = {0, 1, 0, 1};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Translate {-0.02, 0, 0} { Point{1}; }
Rotate {{0, 0, 1}, {0, 0.3, 0}, -Pi/4} { Duplicata{ Point{3}; } }
out[] = Symmetry {1, 0, 0, -2} { Duplicata{ Surface{1}; } };
Dilate {{0, 0, 0}, 0.5} { Surface{out[0]}; }
Dilate {{0, 0, 0}, {2, 1, 1}} { Point{4}; }
