DefineConstant[
  angle = {90, Min 0, Max 120, Step 1, Name "Parameters/Twisting angle", Units "degree", Help "How far
it turns"}
  n = {3, Choices{1="one", 3="three"}, Name "Parameters/Count", ReadOnly 0, Visible 1, Highlight "AliceBlue"},
  name = {"steel", Choices{"steel", "glass"}, Name "Parameters/Name", AutoCheck 0, Closed 1}, plain, other = 5
];
h = DefineNumber[0.1, Name "Parameters/h", Min 1e-5, Label "height", Range{0, 1}];
s = DefineString["a", Name "Parameters/s", Choices{"a", "b"}];
If (!StrCmp(name, "steel") && Exists(nowhere) == 0)
  Point(1) = {h, angle, n};
EndIf
SetNumber("Parameters/h", 2); x = GetNumber("Parameters/h", 3) + GetForced(absent, 7);
Point(2) = {x, plain, other};
