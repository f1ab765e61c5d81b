"""Structure of a drawing's tokens: matching brackets, and nesting of loops, tests and macros.

Gmsh jumps back to the line after the head of a loop or a macro, and finds the end of a skipped block by its name alone.
Heads must therefore stand alone on their lines, ends must be real ends, and statements between them must be whole.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from pdmesh.drawing.sandbox.tokens import Refused, Token

OPENING = {"(": ")", "[": "]", "{": "}"}
DEEPEST = 100  # brackets inside each other
CLOSING = {end: start for start, end in OPENING.items()}
ENDS = {"EndFor": "For", "EndIf": "If", "Return": "Macro", "ElseIf": "If", "Else": "If"}
# what Gmsh's skipping reader takes for an end although its lexer does not
HIDDEN_END = re.compile(r"(?:EndIf|EndFor|Else|Return)(?![A-Za-z_])")


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
