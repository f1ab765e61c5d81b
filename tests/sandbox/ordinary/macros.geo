Macro CheeseHole
  p1 = newp; Point(p1) = {x, y, 0, r};
  p2 = newp; Point(p2) = {x + r, y, 0, r};
  p3 = newp; Point(p3) = {x - r, y, 0, r};
  c1 = newc; Circle(c1) = {p2, p1, p3};
  c2 = newc; Circle(c2) = {p3, p1, p2};
  theloops~{t} = newcl; Curve Loop(theloops~{t}) = {c1, c2};
  holes[t] = theloops~{t};
Return

x = 0; y = 0.75; r = 0.09; holes[] = {};
For t In {1:5} // along a line
  x += 0.166; y -= 0.1;
  If (t != 3) Call CheeseHole; EndIf
  Printf("Hole %g (center = {%g, %g}) has loop %5.2g", t, x, y, r);
EndFor
Plane Surface(news) = {holes[1]};
