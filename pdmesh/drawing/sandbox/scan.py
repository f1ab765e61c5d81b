"""The words a drawing may contain: every word is either on a list (words.py), in its place, or a name of the drawing's.

Gmsh's grammar (src/parser/Gmsh.y) has keywords with a fixed meaning, and other words, which are names or commands:
``NAME "text";`` runs a program if NAME is SystemCall. A word that is not listed in its place is therefore taken as a
name and written anew with the prefix OWN, so that it cannot be a command in any version of Gmsh. The rules look only at
neighbouring tokens, as Gmsh resumes behind the next ``;`` after an error, and jumps back to other lines in loops.

Structure of a drawing's tokens: matching brackets, and nesting of loops, tests and macros.

Gmsh jumps back to the line after the head of a loop or a macro, and finds the end of a skipped block by its name alone.
Heads must therefore stand alone on their lines, ends must be real ends, and statements between them must be whole.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import NamedTuple

from pdmesh.drawing.sandbox import words
from pdmesh.drawing.sandbox.tokens import LONGEST_STRING, Refused, Token

OPENING = {"(": ")", "[": "]", "{": "}"}
DEEPEST = 100  # brackets inside each other
CLOSING = {end: start for start, end in OPENING.items()}
ENDS = {"EndFor": "For", "EndIf": "If", "Return": "Macro", "ElseIf": "If", "Else": "If"}
# what Gmsh's skipping reader takes for an end although its lexer does not
HIDDEN_END = re.compile(r"(?:EndIf|EndFor|Else|Return)(?![A-Za-z_])")
OWN = "own__"  # begins the drawing's own names in what Gmsh reads
HARMLESS = "a word known to reach for no other file or program, or a name that the drawing defines"
READS = ("Include", "Merge", "MergeWithBoundingBox", "ShapeFromFile")
MESSAGES = ("Printf", "Error", "Warning")
ASSIGNMENTS = ("=", "+=", "-=", "*=", "/=", "++", "--")
MOST_INDICES = 4  # of a~{1}~{2}...: names of any length would overflow Gmsh's messages
# What is printed with numbers in it goes through C's printf, a conversion and what follows it at a time, into a buffer
# of Gmsh's: anything but plain numbers would read or write memory, and %f has a digit for each power of ten
PIECE = re.compile(
    r"(?:%%|(?P<number>%[-+ 0#]?(?P<width>[0-9]{0,2})(?:\.(?P<digits>[0-9]{1,2}))?l?(?P<kind>[gGeEfF])))[^%\n\r]*"
)
TEXT = re.compile(r"(?:[^%\n\r]|%%)*")
BUFFER = 255  # bytes
MORE = len("-.e+308") + len("0.000")  # of a number, beside its digits


def partners(tokens: Sequence[Token]) -> tuple[dict[int, int], list[int]]:
    """The matching bracket of each bracket, and the nesting depth of each token. Raises Refused."""
    partner: dict[int, int] = {}
    open_at: list[int] = []
    depths = []
    for place, token in enumerate(tokens):
        depths.append(len(open_at))
        if token.text in OPENING:
            open_at.append(place)
            if len(open_at) > DEEPEST:
                raise Refused(token.line, f"{len(open_at)} brackets inside each other", f"at most {DEEPEST}")
        elif token.text in CLOSING:
            if not open_at or tokens[open_at[-1]].text != CLOSING[token.text]:
                expected = f"'{OPENING[tokens[open_at[-1]].text]}' first" if open_at else "one that is open"
                raise Refused(token.line, f"'{token.text}'", expected)
            depths[-1] -= 1
            partner[place] = open_at.pop()
            partner[partner[place]] = place
        elif token.text == ";" and open_at and tokens[open_at[-1]].text != "{":
            raise Refused(token.line, "';'", f"'{OPENING[tokens[open_at[-1]].text]}' first")
    if open_at:
        unclosed = tokens[open_at[-1]]
        raise Refused(unclosed.line, f"'{unclosed.text}'", f"'{OPENING[unclosed.text]}' after it")
    return partner, depths


def heads(tokens: Sequence[Token], partner: dict[int, int], depths: Sequence[int]) -> set[int]:
    """Positions of the last tokens of all heads and ends of loops, tests and macros. Raises Refused."""
    head_ends: set[int] = set()
    blocks: list[Token] = []
    for place, token in enumerate(tokens):
        if token.kind != "word":
            continue
        if token.text not in ENDS and HIDDEN_END.search(token.text):
            raise Refused(token.line, f"'{token.text}'", "a name that Gmsh does not take for the end of a block")
        if token.text not in ("If", "For", "Macro", "Function", "Call", *ENDS):
            continue
        if depths[place]:
            raise Refused(token.line, f"'{token.text}'", "it outside of brackets")
        last = _last(tokens, place, partner)
        head_ends.add(last)
        _nest(token, blocks)
        # nothing may follow a head on its line, as Gmsh would read it out of order
        if token.text not in ("If", "ElseIf", "Else", "EndIf"):
            next_place = last + 1
            while token.text == "Call" and next_place < len(tokens) and tokens[next_place].text == "EndIf":
                next_place += 1
            if next_place < len(tokens) and tokens[next_place].row == tokens[last].row:
                raise Refused(
                    tokens[next_place].line,
                    f"'{tokens[next_place].text[:40]}' behind '{token.text}'",
                    "a new line (Gmsh goes on at the next line, not behind it)",
                )
    if blocks:
        raise Refused(blocks[-1].line, f"'{blocks[-1].text}'", "its end after it")
    return head_ends


def _last(tokens: Sequence[Token], place: int, partner: dict[int, int]) -> int:
    """Position of the last token of the head or end that begins at `place`. Raises Refused."""
    token, rest = tokens[place], [following.text for following in tokens[place + 1 : place + 4]]
    match token.text, rest:
        case (("EndFor" | "EndIf" | "Else" | "Return"), _):
            return place
        case (("If" | "ElseIf" | "For"), ["(", *_]):
            return partner[place + 1]
        case "For", [_, "In", "{"] if tokens[place + 1].kind == "word":
            return partner[place + 3]
        case (("Macro" | "Function"), [_, *_]) if tokens[place + 1].kind == "word":
            return place + 1
        case "Call", [_, ";", *_] if tokens[place + 1].kind == "word":
            return place + 2
    raise Refused(token.line, f"'{' '.join([token.text, *rest[:1]])}'", f"{token.text} and what belongs to it")


def _nest(token: Token, blocks: list[Token]) -> None:
    kind = "Macro" if token.text == "Function" else token.text
    if kind in ("If", "For", "Macro"):
        blocks.append(token._replace(text=kind))
    elif kind in ENDS:
        if not blocks or blocks[-1].text != ENDS[kind]:
            expected = f"the end of '{blocks[-1].text}' of line {blocks[-1].line} first" if blocks else "its beginning"
            raise Refused(token.line, f"'{token.text}'", expected)
        if not kind.startswith("Else"):
            blocks.pop()


class Reading(NamedTuple):
    """A file that a drawing reads: the command, and the position of the file's name among the tokens."""

    command: str
    place: int


class Drawing:
    """Tokens of a drawing with their neighbours and brackets. Raises Refused if brackets or blocks do not match."""

    def __init__(self, tokens: Sequence[Token]) -> None:
        self.tokens = tokens
        self.partner, self.depths = partners(tokens)
        self.heads = heads(tokens, self.partner, self.depths)

    def text(self, place: int) -> str:
        """The token at a position; "" outside the drawing."""
        return self.tokens[place].text if 0 <= place < len(self.tokens) else ""

    def kind(self, place: int) -> str:
        """The kind of the token at a position; "" outside the drawing."""
        return self.tokens[place].kind if 0 <= place < len(self.tokens) else ""

    def starts(self, place: int) -> bool:
        """Whether a statement may begin at a position."""
        return place == 0 or self.text(place - 1) in (";", "}") or place - 1 in self.heads

    def inside(self, word: str) -> set[int]:
        """Positions within the square brackets behind each ``word``."""
        positions, end = set(), 0  # brackets nest: what is open ends with the outermost
        awaited = False  # whether the next bracket is one, unless the statement ends before
        for place, token in enumerate(self.tokens):
            if place < end:
                positions.add(place)
            if token.text == word and token.kind == "word":
                awaited = True
            elif awaited and token.text in ("[", ";"):
                end = max(end, self.partner[place]) if token.text == "[" else end
                awaited = False
        return positions


def names(drawing: Drawing) -> set[str]:
    """Names that the drawing defines or tests by ``Exists``."""
    defined_names = set()
    constants, structs = drawing.inside("DefineConstant"), drawing.inside("Struct")
    for place, token in enumerate(drawing.tokens):
        if token.kind != "word":
            continue
        behind = place + 1  # a name may have an index, such as ``a~{i}(2)``
        while drawing.text(behind) == "~" and drawing.text(behind + 1) == "{":
            behind = drawing.partner[behind + 1] + 1
        behind = drawing.partner[behind] + 1 if drawing.text(behind) in ("(", "[") else behind
        if (
            drawing.text(behind) in ASSIGNMENTS
            or drawing.text(place - 1) in ("For", "Macro", "Function", "Struct", "::")
            or drawing.text(place - 2) in ("Exists", "GetForced", "GetForcedStr")
            or (place in constants and drawing.text(place - 1) in (",", "[") and drawing.text(place + 1) in (",", "]"))
            or (place in structs and drawing.text(place - 1) in (",", "["))
        ):
            defined_names.add(token.text)
    return defined_names


def readings(drawing: Drawing) -> list[Reading]:
    """Files that a drawing reads. Raises Refused for one that is not named by a literal string."""
    file_readings = []
    for place, token in enumerate(drawing.tokens):
        if token.kind == "word" and token.text in READS:
            called = token.text == "ShapeFromFile"
            name = place + 2 if called else place + 1
            around = drawing.text(place + 1), drawing.text(name + 1)
            if drawing.kind(name) != "string" or (around != ("(", ")") if called else around[1] != ";"):
                following = "" if called else " " + drawing.text(place + 1)
                raise Refused(token.line, f"'{token.text}{following}'", "a file named by a string", trustable=True)
            file_readings.append(Reading(token.text, name))
    return file_readings


def admitted(drawing: Drawing, drawing_names: Collection[str]) -> list[Token]:
    """The tokens that Gmsh may read, with names marked; `drawing_names` are the names of all files that are read.

    Raises Refused for the first word that is not known to be harmless in its place.
    """
    admitted_tokens = list(drawing.tokens)
    for place, token in enumerate(drawing.tokens):
        if token.kind == "word" and not _listed(drawing, place, drawing_names):
            member = drawing.text(place - 1) == "."
            if not member and (token.text not in drawing_names or token.text in KEYWORDS):
                dotted = drawing.text(place + 1) == "." and drawing.kind(place + 2) == "word"
                name = f"{token.text}.{drawing.text(place + 2)}" if dotted else token.text
                raise Refused(token.line, f"'{name}'", HARMLESS, trustable=True)
            admitted_tokens[place] = token._replace(text=OWN + token.text)
        elif token.kind == "word" and token.text in MESSAGES:  # what a message says of a number is no matter
            text = drawing.tokens[place + 2]
            admitted_tokens[place + 2] = text._replace(text=f"{text.text[0]}{_plain(text.content)}{text.text[0]}")
        elif token.text == "." and token.kind == "sign" and drawing.kind(place + 1) != "word":
            raise Refused(token.line, "'.'", "a name after it")
        elif token.text == "~" and token.kind == "sign":
            count, before = 1, place
            while drawing.text(before - 1) == "}" and drawing.text(drawing.partner[before - 1] - 1) == "~":
                count, before = count + 1, drawing.partner[before - 1] - 1
            if count > MOST_INDICES:
                raise Refused(token.line, f"{count} of '~{{...}}' in a row", f"at most {MOST_INDICES}")
    return admitted_tokens


def _listed(drawing: Drawing, place: int, drawing_names: Collection[str]) -> bool:
    """Whether a word is harmless in its place. Raises Refused for an option that is not listed."""
    text = drawing.text(place)
    if drawing.text(place - 1) == ".":
        # an option that may be set; if not, it is a name, a member of a Struct
        owner, member = drawing.text(place - 2), drawing.text(place)
        listed: Collection[str]
        if owner == "]" and drawing.text(drawing.partner[place - 2] - 1) == "Field":
            listed = words.FIELD_OPTIONS
        elif owner == "Color" and drawing.text(place - 3) == ".":
            listed = words.OPTION_COLORS.get(drawing.text(place - 4), ())
        elif owner in words.OPTIONS:
            listed = words.OPTIONS[owner] | {"Color"}
        elif drawing.kind(place - 2) == "word":
            return member in words.PLAIN | words.ATTRIBUTES  # of a Struct
        else:
            listed = ()
        if member not in listed:
            owner = drawing.text(drawing.partner[place - 2] - 1) + "[...]" if owner == "]" else owner
            raise Refused(drawing.tokens[place].line, f"'{owner}.{member}'", HARMLESS, trustable=True)
        return True
    rule = KEYWORDS.get(text) or ROLES.get(text)
    if rule is not None and rule(drawing, place):
        either = text in words.ATTRIBUTES and drawing.text(place + 1) in ("-", ",", "}")
        return text in KEYWORDS or not (either and text in drawing_names)
    return text in words.COLORS and (text not in drawing_names or drawing.text(place - 1) == "Color")


# ---- rules: whether the word at a place is harmless there

Rule = Callable[[Drawing, int], bool]


def _anywhere(drawing: Drawing, place: int) -> bool:
    return True


def _message(drawing: Drawing, place: int) -> bool:
    """Printf, Error, Warning: printing is harmless unless it goes to a file."""
    return _prints(drawing, place) and drawing.text(drawing.partner[place + 1] + 1) == ";"


def _sprintf(drawing: Drawing, place: int) -> bool:
    """Sprintf: its result must be short. Raises Refused for formats of unbounded length."""
    if not _prints(drawing, place):
        return False
    token = drawing.tokens[place + 2]
    if _plain(token.content) != token.content:
        raise Refused(token.line, f"'%f' in {token.text[:40]}", "%g or %e, whose length is known", trustable=True)
    return True


def _prints(drawing: Drawing, place: int) -> bool:
    """Whether a format and numbers follow that Gmsh turns into text of bounded length."""
    if drawing.text(place + 1) not in ("(", "[") or drawing.kind(place + 2) != "string":
        return False
    content = drawing.tokens[place + 2].content
    if drawing.text(place + 3) in (")", "]"):
        # no numbers: Gmsh takes the text for the format of a message all the same
        return TEXT.fullmatch(content) is not None and len(content.encode()) <= LONGEST_STRING
    if drawing.text(place + 3) != ",":
        return False
    # each piece of the format, and its output for any numbers, must be short
    content = _plain(content)
    start = content.find("%") if "%" in content else len(content)
    sizes, at = [start], start
    while at < len(content):
        piece = PIECE.match(content, at)
        if piece is None:
            return False
        after = len(piece[0].encode()) - len(piece["number"] or "")
        widest = max(int(piece["width"] or 0), int(piece["digits"] or 6) + MORE) if piece["number"] else 0
        sizes.append(max(len(piece[0].encode()), after + widest))
        at = piece.end()
    return max(sizes) <= BUFFER and sum(sizes) <= LONGEST_STRING and "\n" not in content and "\r" not in content


def _plain(content: str) -> str:
    """A format with %g in place of %f."""

    def with_digits(piece: re.Match[str]) -> str:
        if piece["kind"] not in ("f", "F"):
            return piece[0]
        end = piece.end("kind") - piece.start()
        return piece[0][: end - 1] + {"f": "g", "F": "G"}[piece["kind"]] + piece[0][end:]

    return PIECE.sub(with_digits, content)


def _factory(drawing: Drawing, place: int) -> bool:
    named = drawing.kind(place + 2) == "string" and drawing.tokens[place + 2].content in words.FACTORIES
    return drawing.text(place + 1) == "(" and named and drawing.text(place + 3) == ")"


def _field(drawing: Drawing, place: int) -> bool:
    """``Background Field = 1;``, ``Field[1] = KIND;``, ``Field[1].OPTION = ...;`` or ``Delete Field[1];``."""
    if drawing.text(place - 1) in ("Background", "BoundaryLayer"):
        return drawing.text(place + 1) == "="
    if drawing.text(place + 1) != "[":
        return False
    after_bracket = drawing.partner[place + 1] + 1
    kind = (
        drawing.text(after_bracket) == "="
        and drawing.text(after_bracket + 1) in words.FIELDS
        and drawing.text(after_bracket + 2) == ";"
    )
    deleted = drawing.text(place - 1) == "Delete" and drawing.text(after_bracket) == ";"
    return kind or deleted or drawing.text(after_bracket) == "."


def _kind_of_field(drawing: Drawing, place: int) -> bool:
    named = drawing.text(place - 1) == "=" and drawing.text(place - 2) == "]"
    return named and drawing.text(drawing.partner[place - 2] - 1) == "Field"


def _behind(drawing: Drawing, place: int) -> bool:
    return drawing.text(place) in words.BEHIND.get(drawing.text(place - 1), ())


def _attribute(drawing: Drawing, place: int) -> bool:
    """Whether a token is an attribute in a list, followed by a value or by nothing."""
    follows = drawing.kind(place + 1) in ("string", "number", "word") or drawing.text(place + 1) in ("{", "-", ",", "}")
    return drawing.depths[place] > 0 and drawing.text(place - 1) in (",", "[") and follows


def _named(drawing: Drawing, place: int) -> bool:
    """Whether a token begins a command with one string, as in ``SetName "plate";``."""
    return drawing.starts(place) and drawing.kind(place + 1) == "string" and drawing.text(place + 2) == ";"


def _table(*rules: tuple[Iterable[str], Rule]) -> dict[str, Rule]:
    """Rules by word; if a word has several, one that accepts is enough."""
    rules_by_word: dict[str, list[Rule]] = {}
    for listed, rule in rules:
        for word in listed:
            rules_by_word.setdefault(word, []).append(rule)

    def one_of(of: Sequence[Rule]) -> Rule:
        return lambda drawing, place: any(rule(drawing, place) for rule in of)

    return {word: of[0] if len(of) == 1 else one_of(of) for word, of in rules_by_word.items()}


KEYWORDS = _table(  # which no drawing can take for names
    (words.PLAIN, _anywhere),
    (words.CONTROL, _anywhere),  # looked at by `heads`
    (READS, _anywhere),  # looked at by `readings`
    (("Struct",), _anywhere),
    (MESSAGES, _message),
    (("Sprintf",), _sprintf),
    (("SetFactory",), _factory),
    (("Field",), _field),
)


ROLES = _table(  # of words that are names elsewhere
    *((listed, _behind) for listed in words.BEHIND.values()),
    (words.BEFORE, lambda drawing, at: drawing.text(at + 1) == words.BEFORE[drawing.text(at)]),
    (words.ARRANGEMENTS, lambda drawing, at: drawing.text(at - 1) in ("}", '"*"') and drawing.text(at + 1) == ";"),
    (words.ATTRIBUTES, _attribute),
    (words.FIELDS, _kind_of_field),
    (words.OPTIONS, lambda drawing, at: drawing.text(at + 1) == "."),
    (("SetName",), _named),
)
