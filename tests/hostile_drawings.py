"""What hostile drawings try, one row each: the files, the call, what is said, and whether the attack is a real one.

A real one makes the file ``touched`` as soon as nobody looks (``--trust``). The rest reads where it should not.
"""

from __future__ import annotations

import json
from typing import NamedTuple

import pytest

PLATE = """SetFactory("OpenCASCADE");
DefineConstant[spacing = {1e-3, Name "Peridynamics/Zones/plate/Spacing"}];
Rectangle(1) = {0, 0, 0, 0.01, 0.005};
Physical Surface("zone:plate") = {1};
"""
TOUCH = 'SystemCall "touch touched";\n'
FIELD = """Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Line(1) = {1, 2};
Field[1] = ExternalProcess;
Field[1].CommandLine = "touch touched; kill -9 $PPID";
Background Field = 1;
Mesh 1;
"""
STEP = "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"
BUILD = ("build", "plate.geo")
AGAIN = ("build", "plate.json", "-o", "again.json")


class Attack(NamedTuple):
    """Files by name ("to:NAME" is a link there), the words behind pdmesh, what it says ("": it builds) and if real."""

    files: dict[str, str | bytes]
    said: str
    real: bool = True
    words: tuple[str, ...] = BUILD


def drawing(text: str, said: str, real: bool = True) -> Attack:
    """An attack in one drawing."""
    return Attack({"plate.geo": text}, said, real)


def model(text: str, source: str = "plate.geo") -> str:
    """A model that builds itself again from a drawing."""
    node = {"id": 1, "border": "true", "position": [0, 0, 0], "hole_id": -1, "delta": [1, 1, 0]}
    return json.dumps({"notch": [], "nodes": [node], "source": source, "drawing": text})


ATTACKS = {
    # commands
    "SystemCall": drawing(TOUCH, "line 1: 'SystemCall'"),
    "System": drawing('System "touch touched";\n', "'System'"),
    "NonBlockingSystemCall": drawing('NonBlockingSystemCall "touch touched; sleep 0";\n', "'NonBlockingSystemCall'"),
    "OnelabRun": drawing('OnelabRun("touch touched #");\n', "'OnelabRun'", real=False),
    "the command of a field": drawing(FIELD, "line 2: 'Field'"),
    "the command of a field, in a variable": drawing(
        FIELD.replace("= ExternalProcess", '= Box;\ns = "ExternalProcess"'),
        "'Field[...].CommandLine'",
        real=False,
    ),
    "a plugin": drawing("Plugin(MathEval).Run;\n", "zones: there is none", real=False),
    "a client": drawing('Solver.Executable0 = "touched";\n', "'Solver.Executable0'", real=False),
    "an option that a parameter sets": drawing(
        'DefineConstant[a = {1, Name "x", GmshOption "General.LogFileName"}];\n', "'GmshOption'", real=False
    ),
    "a script in a string": drawing(
        "Geometry.DoubleClickedPointCommand = \"SystemCall 'x';\";\n", "zones: there is none", False
    ),
    "a word made of strings": drawing('StringToName["SystemCall"] "touch touched";\n', "'StringToName'"),
    "the same, short": drawing('S2N[StrCat("System", "Call")] "touch touched";\n', "'S2N'"),
    "the same, in pieces": drawing('DefineConstant[a]; S2N["SystemCall"] "touch touched";\n', "'S2N'"),
    "a name that is defined first": drawing('SystemCall = 1;\nSystemCall "touch touched";\n', "Gmsh says:"),
    "a name that is defined first, in a list": drawing(
        'DefineConstant[System]; System "touch touched";\n', "Gmsh says:"
    ),
    "a name that is defined in a Struct": drawing(
        'Struct S[SystemCall 1]; SystemCall "touch touched";\n', "Gmsh says:"
    ),
    "a keyword that is defined first": drawing(
        'If(0)\nListFromFile = 1;\nEndIf\na() = ListFromFile("secret");\n', "Gmsh says:", real=False
    ),
    # files
    "Save": drawing('Point(1) = {0, 0, 0}; Mesh.Format = 1; Save "touched";\n', "zones: there is none"),
    "Save of a view": drawing('View "a" { SP(0, 0, 0){1}; };\nSave View[0] "touched";\n', "zones: there is none"),
    "Print": drawing('Print.Format = 10; Point(1) = {0, 0, 0}; Print "touched";\n', "zones: there is none", real=False),
    "Save behind a head": drawing(
        'Point(1) = {0, 0, 0};\nIf (1) Save "touched"; EndIf\nFor i In {0:0}\nSave "touched";\nEndFor\n', "none", False
    ),
    "Save that is a name too": drawing(
        'Save = 1; Point(1) = {0, 0, 0};\nSave "touched";\n', "zones: there is none", False
    ),
    "Save that has no end": drawing('Point(1) = {0, 0, 0}; Save "touched"\n', "'Save'", real=False),
    "a command behind what is left out": drawing('View "a" { SP(0, 0, 0){1}; };' + TOUCH, "line 1: 'SystemCall'"),
    "a command within what is left out": drawing('View "a" { ' + TOUCH + " };\n", "zones: there is none", False),
    "a command joined by what is left out": drawing("SystemCall\nSleep 1; 'touch touched';\n", "'System", False),
    "CreateDir": drawing('CreateDir "touched";\n', "'CreateDir'"),
    "Printf": drawing('Printf("x") > "touched";\n', "'Printf'"),
    "Printf of numbers": drawing('Printf("%g", Sqrt(2)) >> "touched";\n', "'Printf'"),
    "Printf in brackets": drawing('Printf("%g", Sin(1)) > StrCat("tou", "ched");\n', "'Printf'"),
    "Printf in two lines far apart": drawing(
        'name = "touched"; name = 3; x = 1;\nFor i In {0:1} y = 5\n> name;\nEndFor Printf("hi")\n;\n',
        "line 2: 'y' behind 'For'",
    ),
    "a log": drawing('General.LogFileName = "touched"; Printf("a");\n', "'General.LogFileName'"),
    "a log, by increments": drawing('General.LogFileName += "touched";\n', "'General.LogFileName'", real=False),
    "a temporary file": drawing('General.TmpFileName = "secret"; Delete All;\n', "'General.TmpFileName'", real=False),
    "Delete All": drawing("Delete All;\n", "'All'", real=False),
    "a list from a file": drawing('a() = ListFromFile("secret");\n', "'ListFromFile'", real=False),
    "a file of a field": drawing('Field[1] = Structured;\nField[1].FileName = "secret";\n', "'Field'", real=False),
    "whether there is a file": drawing('a = FileExists("/etc/passwd");\n', "'FileExists'", real=False),
    "the environment": drawing('DefineConstant[a = {GetEnv("HOME"), Name "b"}];\n', "'GetEnv'", real=False),
    "Include of an absolute path": drawing('Include "/etc/passwd";\n', "'Include \"/etc/passwd\"'", real=False),
    "Include of a computed path": drawing('n = "a.geo"; Include Str(n);\n', "'Include Str'", real=False),
    "ShapeFromFile": drawing('SetFactory("OpenCASCADE"); v() = ShapeFromFile("../a.step");\n', "'ShapeFromFile", False),
    "a window": drawing("SplitCurrentWindowHorizontal 0.5;\n", "'SplitCurrentWindowHorizontal'", real=False),
    "a question at the terminal": drawing('a = GetValue("Password?", 1);\n', "'GetValue'", real=False),
    # readers that disagree
    "a carriage return in a comment": drawing("// \r /*\n" + TOUCH + "// */\n", "line 2: 'SystemCall'"),
    "a string without escapes": drawing('a = "x\\"; ' + TOUCH + 'b = "y";\n', "line 1: 'SystemCall'"),
    "a string of apostrophes": drawing("a = 'x\\'; " + TOUCH + "b = 'y';\n", "line 1: 'SystemCall'"),
    "a string of two lines": drawing('a = "x\n"; ' + TOUCH + 'b = "y";\n', "line 2: 'SystemCall'"),
    "a string that is too long": drawing(
        f'General.AbortOnError = 0;\nGeneral.Verbosity = 0;\na = "{"a" * 1023};; {TOUCH}b = 1;\n', "a string of"
    ),
    "comments as blanks": drawing('/* a */ SystemCall /* b */ "touch touched";\n', "'SystemCall'"),
    "a comment that seems to end": drawing("/*/ a */ " + TOUCH, "'SystemCall'"),
    "a form feed as a blank": drawing('SystemCall\f"touch touched";\n', "'SystemCall'"),
    "a command behind a number": drawing(
        "General.AbortOnError = 0; a = 2e1SystemCall; " + TOUCH, "'General.AbortOnError'"
    ),
    "a quote that skipping loses": drawing(
        "E = 1;\nIf(0)\n E\" EndIf SystemCall 'touch touched'; b = \"; EndIf\n", "zones: there is none"
    ),
    "a quote that a nested test loses": drawing(
        "If(0)\nIf (\"E; EndIf EndIf SystemCall 'touch touched'; a = \") EndIf EndIf\n", "zones: there is none"
    ),
    "a quote that skipping a loop loses": drawing(
        "For i In {1:0}\nField[1].F\" EndFor SystemCall 'touch touched'; b = \"; EndFor\n", "zones: there is none"
    ),
    "the end of a test in a name": drawing("If(0)\n aEndIf2 = 1;\nEndIf\n", "'aEndIf2'", real=False),
    "a loop back into a string": drawing(
        "For i In {0:1} a = \"\nSystemCall 'touch touched'; b = \"; EndFor\n", "line 1: 'a' behind 'For'"
    ),
    "a loop back into a string, closed": drawing(
        "For i In {0:1} a = \"\nSystemCall 'touch touched'; b = \"; c = 1;\nEndFor\n", "line 1: 'a' behind 'For'"
    ),
    "a loop back into a comment": drawing(
        'For i In {0:1} /*\nSystemCall "touch touched"; /* */\nEndFor\n', "zones: there is none"
    ),
    "a macro that begins in a comment": drawing(
        'Macro M /*\nSystemCall "touch touched"; /* */\nReturn\nCall M;\n', "zones: there is none"
    ),
    "a macro that begins in a string": drawing(
        "Macro M a = '\nSystemCall \"touch touched\"; b = ';\nReturn\nCall M;\n", "line 1: 'a' behind 'Macro'"
    ),
    "a macro with a name of strings": drawing('Macro ("x", "System" ); Call x;\n', "'Macro", real=False),
    "a loop back into a line of 9 kB": drawing(
        f'For i In {{0:1}} /*{" " * 9000}SystemCall "touch touched"; */\nEndFor\n', "zones: there is none"
    ),
    "bytes that are no letters": drawing('Sy\u00dftemCall "touch touched";\n', "the character 'ß'", real=False),
    "a zero byte": Attack({"plate.geo": b"a = 1;\n\0\n"}, "a zero byte", real=False),
    # what is read along with a drawing
    "options beside the drawing": Attack({"plate.geo": PLATE, "plate.geo.opt": TOUCH}, ""),
    "options, for its parameters": Attack(
        {"plate.geo": PLATE, "plate.geo.opt": TOUCH}, "", words=("params", "plate.geo")
    ),
    "options, for a plan": Attack({"plate.geo": PLATE, "plate.geo.opt": TOUCH}, "", words=("plan", "plate.geo")),
    "options, for a preview": Attack({"plate.geo": PLATE, "plate.geo.opt": TOUCH}, "", words=("preview", "plate.geo")),
    "options beside what is merged": Attack(
        {"plate.geo": PLATE + 'Merge "a.geo";\n', "a.geo": "b = 1;\n", "a.geo.opt": TOUCH}, ""
    ),
    "options that are merged": Attack({"plate.geo": PLATE + 'Merge "a.opt";\n', "a.opt": TOUCH}, "line 5: 'Merge"),
    "a script in a STEP file": Attack({"plate.geo": 'Include "a.step";\n', "a.step": TOUCH}, "line 1: 'Include"),
    "a script in a .stp file": Attack({"plate.geo": 'Include "a.stp";\n', "a.stp": STEP + TOUCH}, "'Include", False),
    "a script in a BREP file": Attack({"plate.geo": 'Include "a.brep";\n', "a.brep": TOUCH}, "'Include"),
    "a suffix in odd case": Attack({"plate.geo": 'Merge "a.sTep";\n', "a.sTep": TOUCH}, "line 1: 'Merge"),
    "a suffix in odd case, with its box": Attack(
        {"plate.geo": 'MergeWithBoundingBox "a.Brep";\n', "a.Brep": TOUCH}, "'MergeWithBoundingBox"
    ),
    "a script called a STEP file": Attack({"a.step": TOUCH}, "a STEP file", False, ("build", "a.step")),
    "a mesh called a drawing": Attack(
        {"plate.geo": 'Merge "a.geo";\n', "a.geo": "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"},
        "a.geo: line 1: the",
        False,
    ),
    "a program that is merged": Attack({"plate.geo": 'Merge "a.py";\n', "a.py": "x\n"}, "'Merge", real=False),
    "a command two files away": Attack(
        {"plate.geo": 'Include "a.geo";\n', "a.geo": 'Include "b.geo";\n', "b.geo": "\n\n" + TOUCH},
        "b.geo: line 3",
    ),
    "a name defined in another file": Attack(
        {"plate.geo": 'Include "a.geo";\nSystem "touch touched";\n', "a.geo": "System = 1;\n"}, "Gmsh says"
    ),
    "a file that includes itself": Attack(
        {"plate.geo": 'Include "plate.geo";\n'}, "a file that does not read itself", False
    ),
    "a link to another folder": Attack({"plate.geo": 'Include "a.geo";\n', "a.geo": "to:../secret"}, "'Include", False),
    "a link that the folder is": Attack({"plate.geo": 'Include "f/secret";\n', "f": "to:.."}, "'Include", False),
    "a folder above": Attack({"plate.geo": 'Merge "../secret";\n'}, "'Merge", real=False),
    "a module of Python beside the drawing": Attack(
        {"plate.geo": PLATE, "json.py": "open('touched', 'w')\n"}, "", False
    ),
    # models that build themselves again
    "a model's drawing": Attack({"plate.json": model(TOUCH)}, "'SystemCall'", words=AGAIN),
    "a model's field": Attack({"plate.json": model(FIELD)}, "'Field'", words=("plan", "plate.json")),
    "a model's comment": Attack(
        {"plate.json": model("// \r /*\n" + TOUCH + "// */\n")}, "line 2: 'SystemCall'", words=AGAIN
    ),
    "a model's odd suffix": Attack({"plate.json": model(TOUCH, "a.sTep")}, "a STEP file", False, AGAIN),
    "a model's file elsewhere": Attack(
        {"plate.json": model('Include "a.geo";\n'), "a.geo": TOUCH}, "'Include", False, AGAIN
    ),
    "a model's path": Attack({"plate.json": model(TOUCH, "../a.geo")}, "$.source", False, AGAIN),
}
BREAKING = {  # what would break or fill the process
    "a format that reads memory": drawing('Printf("%s%s%s%s");\n', "'Printf'", real=False),
    "a format that writes memory": drawing('a = Sprintf("%n", 1);\n', "'Sprintf'", real=False),
    "a format in a variable": drawing('f = "%n"; Printf(f, 1);\n', "'Printf'", real=False),
    "a format of 1e9 digits": drawing('Error("%999999999f", 1);\n', "'Error'", real=False),
    "a number of any length": drawing(
        'Printf("%f", 1e300); Error("%.2F, ", 1e300);\n', "Gmsh says: 1E+300,", real=False
    ),
    "a text of any length": drawing('a = Sprintf("%f", 1e300);\n', "line 1: '%f' in", real=False),
    "a text behind a number": drawing(f'Printf("%g {"x" * 245}", 1);\n', "'Printf'", real=False),
    "a text of long letters": drawing(f'Printf("%g {"ä" * 125}", 1);\n', "'Printf'", real=False),
    "a text of many numbers": drawing(f'a = Sprintf("{"%99g" * 11}", {{1:11}});\n', "'Sprintf'", real=False),
    "a message of a number that is not there": drawing('Warning("%g");\n', "'Warning'", real=False),
    "a name of any length": drawing("a = 1; x = a" + "~{1}" * 200 + ";\n", "5 of '~{...}'", real=False),
    "a long name": drawing("a" * 5000 + " = 1;\n", "of 5000 bytes", real=False),
    "a write before a list": drawing("a[] = {1}; a[-100000000] = 1;\n", "Gmsh stopped before the end", real=False),
    "more memory than there is": drawing("a() = {}; a(500000000) = 1;\n", "plate.geo: Gmsh s", real=False),
    "ends without a beginning": drawing("EndIf EndIf If(1) EndIf\n", "line 1: 'EndIf'", real=False),
    "an early end": drawing("Exit;\n", "'Exit'", real=False),
    "silence": drawing('General.Verbosity = 0;\nPhysical Point("a") = {9};\n', "'General.Verbosity'", real=False),
}
SOON = {  # one of each kind that is real: the quick tests do without the others
    *("SystemCall", "the command of a field", "a word made of strings", "a name that is defined first", "CreateDir"),
    *("Save", "Printf", "a log", "a carriage return in a comment", "a string without escapes"),
    *("a loop back into a string", "options beside the drawing", "a script in a STEP file"),
    *("a command two files away", "a model's drawing"),
}
REAL = [
    pytest.param(name, marks=() if name in SOON else pytest.mark.slow)
    for name, attack in ATTACKS.items()
    if attack.real
]
