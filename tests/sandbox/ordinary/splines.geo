Point(1) = {0, 0, 0}; Point(2) = {1, 0.5, 0}; Point(3) = {2, 0, 0}; Point(4) = {3, 1, 0};
Spline(1) = {1, 2, 3, 4}; BSpline(2) = {1:4}; Bezier(3) = {1, 2, 3, 4}; CatmullRom(4) = {1, 3, 4};
Compound Spline(5) = {1} Using 10;
Nurbs(6) = {1, 2, 3, 4} Knots {0, 0, 0, 0, 1, 1, 1, 1} Order 3;
Point(20) = {0, 0, 0}; Point(21) = {2, 0, 0}; Point(22) = {0, 1, 0}; Point(23) = {1, 0, 0};
Ellipse(10) = {21, 20, 21, 22};
Circle(11) = {23, 20, 22};
Compound Curve {2, 3};
