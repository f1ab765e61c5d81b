x = Sin(1) + Cos(1)*Tan(1) - Asin(0.5)/Acos(0.5) + Atan(1)^2 + Atan2(1, 2) + Sqrt(2) + Exp(1) + Log(2)
  + Log10(3) + Sinh(1) + Cosh(1) + Tanh(1) + Fabs(-1) + Floor(1.5) + Ceil(1.5) + Round(1.4) + Fmod(5, 3)
  + Modulo(5, 3) + Hypot(3, 4) + Max(1, 2) + Min(1, 2) + Abs(-2) + Step(1) + 1.5e-3 + .5 + 2.;
x++; x -= 1; x *= 2; x /= 3;
Point(1) = {x, -x, +x};
