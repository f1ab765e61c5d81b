Struct Opening [ r 0.5, at {1, 2}, name "a" ];
Point(1) = {Opening.r, Opening.at(0), Opening.at(1)};
Struct A::B [ x 3 ];
Point(2) = {A::B.x, 0, 0};
