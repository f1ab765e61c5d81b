Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Point(3) = {1, 1, 0, 1};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 1};
Line Loop(4) = {1, 2, 3};
Ruled Surface(5) = {4};
Point(6) = {0.8, 0.2, 0}; Point(7) = {0.9, 0.5, 0};
Line(8) = {6, 7};
Line{8} In Surface{5};
Physical Line("crack") = {8};
