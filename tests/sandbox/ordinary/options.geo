Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Point(3) = {1, 1, 0, 1}; Point(4) = {0, 1, 0, 1};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Mesh.MeshSizeExtendFromBoundary = 0; Mesh.MeshSizeFromPoints = 0; Mesh.Algorithm = 5; Mesh.ElementOrder = 2;
Geometry.PointNumbers = 1; Geometry.Color.Points = Orange; General.Color.Text = White; Mesh.Color.Points = {255, 0, 0};
General.Trackball = 0; General.RotationX = 20; Geometry.Tolerance *= 2; Geometry.OldNewReg = 1; Mesh.SaveAll = 1;
Color Red { Surface{1}; }
Recursive Color SteelBlue { Curve{1}; }
Hide { Point{1}; }
Show {:}
x = Mesh.MeshSizeFactor; Mesh.MshFileVersion = 2.2;
