"""Pages of the site that are made and not written: sections of README.md, the programs' help, schema, public names.

MkDocs calls `on_files` once a build (hooks in mkdocs.yml). A section that gets a page of its own in docs/ leaves
README.md.
"""

from __future__ import annotations

import argparse
import inspect
import json
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parent.parent
PROGRAMS = ("pdmesh", "pdsolve", "pdpost")


def on_files(files: Files, config: Any) -> Files:
    """The pages that MkDocs has found, with those made here."""
    written = {file.src_uri for file in files}
    for name, text in pages().items():
        if name not in written:
            files.append(File.generated(config, name, content=text))
    for picture in sorted((ROOT / "benchmarks").glob("*.png")):
        files.append(File.generated(config, f"benchmarks/{picture.name}", abs_src_path=str(picture)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """A page with links to the pages that are made of README.md."""
    markdown = re.sub(r"\]\(\.\./README\.md#([a-z0-9-]+)\)", r"](guide/\1.md)", markdown)
    return markdown.replace("](../README.md)", "](index.md)")


def pages() -> dict[str, str]:
    """All pages that are made, by their names."""
    sections = dict(_sections((ROOT / "README.md").read_text(encoding="utf-8")))
    found = {f"guide/{name}.md": _moved(text, "../") for name, text in sections.items() if name != "index"}
    found["index.md"] = _moved(sections["index"] + sections.get("two-commands", ""), "")
    reference = {"cli": _help(), "schema": _schema(), "api": "".join(_names())}
    return found | {f"reference/{name}.md": text for name, text in reference.items()}


def _sections(readme: str) -> Iterator[tuple[str, str]]:
    """Name and text of each section; what is above the first is called index."""
    first, *others = re.split(r"^(?=## )", readme, flags=re.MULTILINE)
    yield "index", first
    for text in others:
        title = text.splitlines()[0].removeprefix("## ")
        yield re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-"), text.replace("## ", "# ", 1)


def _moved(text: str, up: str) -> str:
    """A text of README.md with links as from a page of the site."""
    text = re.sub(r"\]\(docs/", f"]({up}", text)
    text = re.sub(r"\]\(benchmarks/", f"]({up}benchmarks/", text)
    guide = "" if up else "guide/"
    return re.sub(r"\]\(#([a-z0-9-]+)\)", rf"]({guide}\1.md)", text)


def _help() -> str:
    """What each program, and each of its commands, says when it is asked for help."""
    parts = ["# Command line\n"]
    for name in PROGRAMS:
        parser = import_module(f"{name}.__main__").parser()
        parts.append(_words(parser, 2))
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                parts += [_words(command, 3) for command in action.choices.values()]
    study = import_module("pdsolve.study.command").parser()
    return "\n".join([*parts, _words(study, 2)])


def _words(parser: argparse.ArgumentParser, level: int) -> str:
    return f"{'#' * level} {parser.prog}\n\n```text\n{parser.format_help()}```\n"


def _schema() -> str:
    document = import_module("pdmesh.model.document")
    return f"# Schema of the grid file\n\n```json\n{json.dumps(document.schema(), indent=2)}\n```\n"


def _names() -> Iterator[str]:
    """The public names of the three packages, with what they say of themselves."""
    yield "# Python\n"
    for name in (*PROGRAMS, "pdpost.figures"):
        package = import_module(name)
        yield f"\n## {name}\n\n{inspect.getdoc(package)}\n"
        for public in package.__all__:
            found = getattr(package, public)
            if inspect.ismodule(found):
                continue
            try:
                signature = str(inspect.signature(found))
            except (TypeError, ValueError):
                signature = ""
            yield f"\n### {public}\n\n```python\n{public}{signature}\n```\n\n```text\n{inspect.getdoc(found)}\n```\n"
