a = "one"; b() = Str("two", "three"); c = StrCat(a, "-", b(1), Sprintf("%.3g %5.2g", Pi, 2));
d = StrChoice(StrFind(c, "one") > 0, UpperCase(a), LowerCase(a)); e = StrSub(a, 1, 2);
f = StrReplace(a, "o", "0"); g = StrPrefix("x.geo"); h = 'single "double" quotes'; i = "two
lines";
Printf("%g", StrLen(c)); Printf('done; "SystemCall" is a word here');
Point(1) = {StrLen(c), StrLen(d) + StrLen(e) + StrLen(g), StrLen(f) + StrLen(h) + StrLen(i)};
Physical Point(StrCat("p", a)) = {1};
