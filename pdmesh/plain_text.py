"""Text from files, file names, databases and command lines, made safe for each place that shows it.

Such text is shown letter by letter: no terminal, spreadsheet, browser or plotting library obeys it.

Output of the three programs is escaped so that a terminal shows control characters and does not obey them.
"""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from html import escape
from typing import TextIO

MOST_OF_A_WORD = 300  # letters without a space in between, such as a path
MOST_OF_A_LINE = 4000  # letters
MOST_IN_A_CELL = 32_000  # letters; spreadsheets take some 700 more
MOST_IN_A_FIGURE = 120  # letters of a line
MOST_OF_A_NAME = 60
LINES_IN_A_FIGURE = 4
BYTES_IN_QUOTES = 200  # Gmsh reads lines of up to 255
LONG_WORD = re.compile(rf"\S{{{MOST_OF_A_WORD + 1},}}")
FORMULA = re.compile(r"\s*[=+@\-\uff1d\uff0b\uff20\uff0d]")  # beginnings that spreadsheets compute, also full-width
QUOTED = re.compile(r"[,;\"'|]|^\s|\s$")  # in a cell: separators of any country, quotes, outer spaces
NOT_IN_FILE_NAMES = re.compile(r"[^\w .()+,=@~-]")


def visible(text: str) -> str:
    """Text with control characters, direction marks and undecodable bytes replaced by their codes.

    Line ends and tabs stay.
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() or sign in "\n\t" else ascii(sign)[1:-1].replace("\\udc", "\\x") for sign in text
    )


def shortened(text: str, most: int) -> str:
    """Text of at most about `most` letters: of a longer one its beginning, its length and its end."""
    if len(text) <= most:
        return text
    end = most // 3
    return f"{text[: most - end]}...({len(text)} letters)...{text[-end:]}"


def for_line(text: str) -> str:
    """Text as one line of a terminal or a message, with long words and long lines shortened."""
    short = LONG_WORD.sub(lambda word: shortened(word[0], MOST_OF_A_WORD), text)
    return visible(shortened(short, MOST_OF_A_LINE)).replace("\n", "\\n")


def for_figure(text: str) -> str:
    """Text for a label of a figure, a few lines of bounded length."""
    lines = text.split("\n")
    if len(lines) > LINES_IN_A_FIGURE:
        lines = [*lines[: LINES_IN_A_FIGURE - 1], "\\n".join(lines[LINES_IN_A_FIGURE - 1 :])]
    return "\n".join(shortened(visible(line).replace("\t", "\\t"), MOST_IN_A_FIGURE) for line in lines)


def for_legend(name: str) -> str:
    """A name in a legend or a title, as one short line.

    Matplotlib leaves labels out that begin with an underscore.
    """
    line = shortened(visible(name), MOST_OF_A_NAME).replace("\n", "\\n")
    return f" {line}" if line.startswith("_") else line


def for_quotes(name: str) -> str:
    """A name between double quotes on a line of a file, as in Gmsh's format, which has no sign for a quote in it."""
    line = visible(name).replace("\n", "\\n").replace("\t", "\\t").replace('"', "'")
    short, most = line, len(line)
    while len(short.encode()) > BYTES_IN_QUOTES:  # letters of several bytes may stand at one end
        most = most * 9 // 10
        short = shortened(line, most)
    return short


def for_csv(value: object) -> str:
    """A cell of a table in CSV, quoted if need be: a number in full, None as an empty cell, text as text.

    Text that a spreadsheet would compute begins with an apostrophe, which spreadsheets take as the mark of text.
    """
    if value is None:
        return ""
    if not isinstance(value, str):
        return repr(value) if isinstance(value, float) else str(value)
    cell = shortened(visible(value), MOST_IN_A_CELL).replace("\n", "\\n").replace("\t", "\\t")
    if FORMULA.match(cell):
        try:
            float(cell)
        except ValueError:
            cell = f"'{cell}"
    return '"' + cell.replace('"', '""') + '"' if QUOTED.search(cell) else cell


def for_html(text: object) -> str:
    """Text for HTML, between tags or in a quoted attribute."""
    return escape(shortened(visible(str(text)), MOST_OF_A_LINE))


def for_srcdoc(page: str) -> str:
    """A whole page of HTML for the attribute `srcdoc` of a frame, in which its texts are plain already."""
    return escape(page)


def for_file_name(name: str) -> str:
    """A name for a file that other files refer to: one that is not all printable text gets underscores for the rest."""
    return name if name.isprintable() else NOT_IN_FILE_NAMES.sub("_", visible(name).replace("\\x", "_"))


class UnprintedError(Exception):
    """Output that cannot be written: the other end of a pipe has closed, or a disk is full."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"stdout: {error.strerror}")
        self.is_closed = isinstance(error, BrokenPipeError)  # by one who has seen enough, such as head


def print_text(text: str, file: TextIO | None = None, end: str = "\n") -> None:
    """Print on stdout, or another stream. Raises UnprintedError."""
    stream = sys.stdout if file is None else file
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        stream.write((visible(text) + end).encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()
    except OSError as error:
        raise UnprintedError(error) from None


def print_to_stderr(message: str) -> None:
    """Print a line on stderr; errors in writing are ignored."""
    with suppress(UnprintedError):
        print_text(for_line(message), sys.stderr)


def leave_stdout() -> None:
    """Discard what is left to print, so that Python does not complain at exit."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
