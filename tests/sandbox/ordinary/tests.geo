a = 3;
If (a > 2 && !(a == 5))
  If (a % 2)
    Point(1) = {1, 0, 0};
  Else
    Point(1) = {2, 0, 0};
  EndIf
ElseIf (a < 0 || a != 1)
  Point(2) = {0, 0, 0};
Else
  Error("no"); // E" EndIf
EndIf
If (0)
  Printf("a string with ' EndIf in it");
  For i In {1:3}
    If (i)
    EndIf
  EndFor
ElseIf (1)
  Point(4) = {4, 4, 0};
EndIf
b = (a >= 3) ? 1 : 2; c = a <= 1 ? 1 : (a > 1 ? 4 : 5);
Point(3) = {b, c, Fabs(-1)};
