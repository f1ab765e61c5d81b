For (1:3)
  Point(newp) = {0.5, 0, 0};
EndFor
For i In {5:1:-2}
  For j In {0:1} /* inner */
    Point(newp) = {i, j, 0};
  EndFor
EndFor
l() = LinSpace(0, 1, 3); m[] = LogSpace(0, 1, 3);
n() = {1:3, 5, l()}; n[] += 7; n() -= {5};
k = #n(); q = n(0) + n[1] + m[2]; i = 0; i++; n[i] *= 2;
Point(100) = {q, k, l(2)}; Point(101) = {n[1], i, 1};
