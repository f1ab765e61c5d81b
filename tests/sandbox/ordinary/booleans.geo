SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 2, 1, 0.1}; Disk(2) = {1, 0.5, 0, 0.3}; Disk(3) = {0, 0, 0, 0.5, 0.2}; Disk(4) = {2, 0.5, 0, 0.6};
a() = BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; };
b() = BooleanIntersection{ Surface{a()}; }{ Surface{3}; Delete; };
BooleanUnion(20) = { Surface{a()}; Delete; }{ Surface{4}; Delete; };
f() = BooleanFragments{ Surface{20}; Delete; }{ Surface{b()}; Delete; };
Physical Surface("all") = {f()};
Physical Curve("left") = Curve In BoundingBox{-1, -1, -1, 0.01, 2, 1};
e() = Abs(Boundary{ Surface{f()}; }); u() = Unique(Abs(CombinedBoundary{ Surface{f()}; }));
Physical Curve("rim") = {u()};
Recursive Delete { Surface{f(0)}; }
