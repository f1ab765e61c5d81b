"""Pages of which each command writes its own section."""

from __future__ import annotations

import re
from pathlib import Path


def put_section(page: Path, text: str) -> None:
    """Put a section, which begins with a heading of the second level, in place of that of this heading, or last."""
    heading = text.splitlines()[0]
    parts = sections(page.read_text(encoding="utf-8"))
    names = [part.splitlines()[0] for part in parts]
    new = text.strip("\n") + "\n"
    if heading in names:
        parts[names.index(heading)] = new
    else:
        parts.append(new)
    page.write_text("\n".join(part.strip("\n") + "\n" for part in parts), encoding="utf-8")


def sections(text: str) -> list[str]:
    """What is before the first heading of the second level, and each from one on."""
    return [part for part in re.split(r"^(?=## )", text, flags=re.MULTILINE) if part.strip()]


def pictured(name: str) -> str:
    """A picture on a page, described by the parts of its file's name: what, scene, mode, step."""
    words = Path(name).stem.replace("_", " ").split(".")
    step = f" after step {words.pop()}" if words[-1].isdigit() else ""
    mode = f" in {words.pop()} mode" if words[-1] in ("thesis", "conservative") else ""
    return f"![{' of '.join(words)}{mode}{step}]({name})"
