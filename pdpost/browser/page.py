"""The page of a run: its files for the server, or one file with the data of some frames that needs no server.

three.js, which draws with WebGL, is that of the package jupyter-threejs-sage (the extra `view`).
"""

from __future__ import annotations

import base64
import re
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdmesh.plain_figure import FigureError
from pdmesh.plain_text import for_html, for_srcdoc
from pdpost.browser import messages
from pdsolve.measures import fields
from pdsolve.measures.frame_steps import frames, has_diffusion_only
from pdsolve.results import Results, ResultsError

LIBRARY = "jupyter_threejs_sage", "static/*/three.min.js"  # the newest of its versions is taken
SCRIPTS = '<script src="three.js"></script>\n<script src="view.js"></script>'
OFFLINE = (
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline';"
    " style-src 'unsafe-inline'; img-src data:\">"
)
FRAMES = 40  # of a file, unless the user says which
LIMIT = 32.0  # MB of numbers in a file
EMBEDDED = 8.0  # MB of numbers in the frame of another page
LEAST = 0.1  # of the nodes
USUAL = ("displacement", "energy")  # fields of a file, with the default one
MARK, ENDS_SCRIPT = re.compile(r"<!--(\w+)-->"), re.compile("</script", re.IGNORECASE)
PLACE, VALUE = 20, 4  # bytes: of a node, and of its value in a frame


class Selection(NamedTuple):
    """What a file has of a run."""

    steps: list[int]
    step_count: int  # of the run
    fields: list[tuple[str, str]]  # name and component
    nodes: int
    node_count: int  # of the run

    @property
    def left_out(self) -> str:
        """What is not in the file, in words; "" if nothing is."""
        counts = ((len(self.steps), self.step_count, "frames"), (self.nodes, self.node_count, "nodes"))
        return " and ".join(f"{total - here} of {total} {what}" for here, total, what in counts if here < total)


def library() -> str:
    """The text of three.js. Raises FigureError."""
    spec = find_spec(LIBRARY[0])
    folder = Path(spec.origin).parent if spec is not None and spec.origin is not None else None
    copies = sorted(folder.glob(LIBRARY[1])) if folder is not None else []
    if not copies:
        raise FigureError("view needs three.js; install it: pip install 'pdsuite[view]'")
    return copies[-1].read_text(encoding="utf-8")


def files(name: str) -> dict[str, tuple[str, bytes]]:
    """The files that the server sends, by address: their kinds and their bytes. Raises FigureError."""
    text = {"title": for_html(name), "policy": "", "note": "", "scripts": SCRIPTS}
    return {
        "": ("text/html; charset=utf-8", _page(text).encode()),
        "three.js": ("text/javascript; charset=utf-8", library().encode()),
        "view.js": ("text/javascript; charset=utf-8", _beside("view.js").encode()),
    }


def select(
    results: Results, stride: int | None, named_fields: Sequence[tuple[str, str]], megabytes: float = LIMIT
) -> Selection:
    """Every `stride`-th frame, or at most `FRAMES`, and as many nodes as `megabytes` of numbers have room for.

    Fields are those named (name, component), or else the default one, displacement and energy. Raises ResultsError
    where a tenth of the nodes has no room, or where a field is not there.
    """
    all_steps = frames(results)[0].tolist()
    rows = np.linspace(0, len(all_steps) - 1, min(len(all_steps), FRAMES)).round().astype(int)  # the first, the last
    steps = all_steps[::stride] if stride else [all_steps[row] for row in np.unique(rows)]
    there = {entry.name: entry for entry in messages.available_fields(results, all_steps[-1])}
    usual = [(name, "") for number, name in enumerate(there) if not number or name in USUAL]
    chosen = []
    for name, part in named_fields or usual:
        component = fields.choose_component(name, part or None, results.dimension) or messages.SCALAR
        if name not in there:
            raise ResultsError(f"{results.name} has no field '{name}'; use some of {', '.join(there)}")
        chosen.append((name, component))
    epochs = {results.epoch(step) for step in steps}
    most = max(len(results.nodes(epoch).ids) for epoch in epochs)
    room = int(megabytes * 1e6 / (len(epochs) * PLACE + len(steps) * len(chosen) * VALUE))
    if room < LEAST * most:
        raise ResultsError(
            f"{results.name}: {megabytes:g} MB have room for {room} of {most} nodes; use fewer frames (--stride), fewer"
            " fields (--field) or more --megabytes"
        )
    return Selection(steps, len(all_steps), list(dict.fromkeys(chosen)), min(room, most), most)


def offline_page(
    results: Results, name: str, chosen: Selection, progress: Callable[[list[int]], Iterable[int]] = iter
) -> str:
    """The page with the data of the frames and fields chosen; it asks no network. Raises ResultsError."""
    cracked = not has_diffusion_only(results)
    data = {"run": messages.run(results, chosen.steps, chosen.fields)}
    addresses = ["charts", messages.USUAL, *["summary"] * cracked]
    addresses += [f"nodes/{epoch}" for epoch in dict.fromkeys(map(results.epoch, chosen.steps))]
    for step in progress(chosen.steps):
        addresses += [f"field/{field}/{part}/{step}" for field, part in chosen.fields] + [f"cracks/{step}"] * cracked
        data |= {address: _known(results, address, chosen.nodes) for address in addresses if address not in data}
    packed = {address: base64.b64encode(zlib.compress(block)).decode() for address, block in data.items()}
    blocks = [
        f'<script type="text/plain" data-address="{for_html(address)}">{text}</script>'
        for address, text in packed.items()
    ]
    sources = [ENDS_SCRIPT.sub(_escaped, source) for source in (library(), _beside("view.js"))]
    scripts = [f"<script>{text}</script>" for text in sources]
    note = f"This file leaves out {chosen.left_out}." if chosen.left_out else ""
    return _page({"title": for_html(name), "policy": OFFLINE, "note": note, "scripts": "\n".join([*blocks, *scripts])})


def embedded(results: Results, name: str) -> str:
    """The page in a frame of another page, and how many frames of the run it has. Raises FigureError, ResultsError."""
    selection = select(results, None, [], EMBEDDED)
    text = for_srcdoc(offline_page(results, name, selection))
    return (
        f'<iframe title="the run over time" sandbox="allow-scripts" srcdoc="{text}"'
        ' style="width: 100%; height: 46rem; border: 1px solid var(--line)"></iframe>'
        f"<p>{for_html(len(selection.steps))} of {for_html(selection.step_count)} frames</p>"
    )


def _known(results: Results, address: str, most: int) -> bytes:
    data = messages.answer(results, address, most)
    assert data is not None  # addresses of this module are known
    return data


def _escaped(end: re.Match[str]) -> str:
    """The end of a script inside a text of JavaScript, where a backslash changes nothing."""
    return end[0].replace("/", "\\/")


def _page(texts: Mapping[str, str]) -> str:
    """The page with `texts` at their marks."""
    return MARK.sub(lambda mark: texts[mark[1]], _beside("view.html"))


def _beside(name: str) -> str:
    """The text of a file of this package."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")
