"""Tokens of a drawing as Gmsh's own lexer (src/parser/Gmsh.l) sees them, and text written anew from them.

Gmsh reads bytes. Blanks are space, tab, line feed, carriage return and form feed; ``//`` ends only at a line feed;
strings have no escapes, may span lines, and break off after 1023 bytes; a number ends where a word begins.

Gmsh has more readers than its lexer. One skips a branch that is not taken; it loses characters and may mistake the end
of a string for its beginning. A loop or a macro jumps back to the beginning of a line, even inside a string or a
comment. Lines are read in pieces of 8 kB. `written` produces text on which all readers agree: no comments, a blank
before every quote, short lines and strings, strings on one line.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

MOST_TOKENS = 3_000_000  # of a drawing, with all drawings that it reads: some 5 s of looking through them
LONGEST_STRING, LONGEST_WORD, LONGEST_LINE = 1000, 100, 4000  # bytes
SKIPPING = {"If", "For"}  # behind them, Gmsh's skipping reader loses up to four characters
PIECES = re.compile(
    rb"""
    [ \t\f]*(?:  # blanks before a token are taken with it
    (?P<comment>//[^\n]* | /\*.*?\*/)
  | (?P<row>\r\n?|\n)
  | (?P<string>"[^"]*" | '[^']*')
  | (?P<word>[A-Za-z_][A-Za-z_0-9]*)
  | (?P<number>(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[Ee][-+]?[0-9]+)? | [0-9]+(?:[Ee][-+]?[0-9]+)?)
  | (?P<sign>\.\.\.|::|\|\||&&|\+\+|--|==|!=|<=|>=|>>|<<|\+=|-=|\*=|/=|(?!/\*)[][(){};:,=+*/^%<>?!.\#~&|-])
  | (?P<blank>[ \t\f]+))
    """,
    re.VERBOSE | re.DOTALL,
)
ROW = re.compile(rb"\r\n?|\n")
# control characters, which could reach a terminal in a message, but for tabs and line ends
CONTROL = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")


class Token(NamedTuple):
    """A token of a drawing; a word is anything that Gmsh takes for a command, a keyword or a name."""

    kind: str  # string, word, number or sign
    text: str
    line: int  # in the file, for messages
    row: int  # the same, but a carriage return ends one too, as for Gmsh's reading line by line

    @property
    def content(self) -> str:
        """The text inside a string's quotes."""
        return self.text[1:-1]


class Refused(Exception):
    """A drawing that is rejected: the line, what was found there and what was expected."""

    def __init__(self, line: int, actual: str, expected: str, trustable: bool = False) -> None:
        self.line, self.actual, self.expected, self.trustable = line, actual, expected, trustable
        super().__init__(f"line {line}: {actual} cannot be read; use {expected}")


def decoded(data: bytes) -> str:
    """The text of a drawing in UTF-8 or else in Latin-1, with line ends unchanged."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def tokens_of(text: str, most: int = MOST_TOKENS) -> list[Token]:
    """The tokens of a drawing. Raises Refused if Gmsh's readers could disagree, or for more than `most` tokens."""
    data = text.encode("utf-8")
    tokens: list[Token] = []
    texts, token = dict[bytes, str](), Token._make  # pieces that are there often are one text
    place, line, row = 0, 1, 1
    for match in PIECES.finditer(data):
        if match.start() != place:
            break
        kind, place = str(match.lastgroup), match.end()
        piece = match[kind]
        if kind == "blank":
            continue
        if kind == "word" or kind == "number" or kind == "sign":
            if len(piece) > LONGEST_WORD:
                raise Refused(line, f"'{piece[:20].decode()}...' of {len(piece)} bytes", f"at most {LONGEST_WORD}")
            if (again := texts.get(piece)) is None:
                again = texts[piece] = piece.decode()
            tokens.append(token((kind, again, line, row)))
            if len(tokens) > most:
                raise Refused(line, f"more than {most} words, numbers and signs", f"at most {MOST_TOKENS} in all")
            continue
        if kind == "string":
            tokens.append(_checked(Token(kind, piece.decode(), line, row)))
        line += piece.count(b"\n")
        row += len(ROW.findall(piece))
    if place < len(data):
        raise _stray(data, place, line)
    return tokens


def _stray(data: bytes, place: int, line: int) -> Refused:
    if data.startswith(b"/*", place):
        return Refused(line, "a comment without an end", "'*/' after it")
    if data[place : place + 1] in (b'"', b"'"):
        return Refused(line, "a string without an end", "a quote after it")
    character = data[place : place + 8].decode(errors="ignore")[:1]
    return Refused(line, f"the character {character!r}", "a Gmsh .geo script")


def _checked(token: Token) -> Token:
    size = len(token.text.encode())
    if size > LONGEST_STRING:
        raise Refused(token.line, f"a string of {size} bytes", f"at most {LONGEST_STRING}")
    if CONTROL.search(token.content):
        raise Refused(token.line, f"a control character in {token.text[:40]!r}", "a string of plain characters")
    return token


def written(tokens: Iterable[Token]) -> tuple[bytes, Sequence[int]]:
    """The drawing written anew, and the original line of each of its lines."""
    lines: list[list[str]] = []
    origins: list[int] = []
    size, row = 0, 0
    for token in tokens:
        text = token.text
        if text in SKIPPING:
            text += 8 * " "
        elif token.kind == "string" and len(pieces := re.split("\r\n?|\n", token.content)) > 1:
            quoted = " , ".join(f"{text[0]}{piece}{text[0]}" for piece in pieces)
            text = f"Str( {quoted} )"  # which joins them with line feeds
        size += len(text.encode()) + 1
        if token.row != row or size > LONGEST_LINE:
            lines.append([])
            origins.append(token.line)
            size, row = len(text.encode()) + 1, token.row
        lines[-1].append(text)
    return "".join(" ".join(line) + "\n" for line in lines).encode() or b"\n", origins
