// names that mean something elsewhere
Left = 1; Range = 2; Distance = 3; Power = 4; Loop = 5; Name = 6; Kind[] = {7, 8};
Red = 9; Model = 10; Index = 11; Mesh = 12; MathEval = 13; Units = Left;
Point(1) = {Left, Range - Name, Kind[1]*Red}; Point(2) = {Power, Loop, Mesh};
Point(3) = {Distance, -Model, Index}; Point(4) = {MathEval, Units, Left};
l() = {Name, Range};
