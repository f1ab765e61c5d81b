"""A run in the browser: a page with a time slider, served to this machine alone or written as one file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.pictures import FIELDS
from pdpost.commands.shared import add_every, add_results, chosen_stride, counted, positive

if TYPE_CHECKING:
    from pdpost.browser.page import Selection
    from pdpost.commands.shared import Commands
    from pdsolve.results import Results

OF_EXPORT = ("field", "megabytes", "every", "stride")  # options that say what is in the file


def add(commands: Commands) -> None:
    """Put `view` on the command line."""
    view = commands.add_parser(
        "view",
        help="show the run in the browser: fields over time, cracks, histories and energy (needs the extra view)",
        description="Serve one page with the fields of all frames on a slider, the paths of cracks, forces, energies"
        " and histories, which follows a run in progress. Only programs on this machine that know the address, which"
        " has a random token, can read it. With --export, write the page with some of the data as one file that works"
        " without a server and without a network. Needs the extra view: pip install 'pdsuite[view]'.",
    )
    add_results(view)
    view.add_argument("--port", type=_port, default=0, metavar="N", help="the port to listen on (default: a free one)")
    view.add_argument("--open", action="store_true", help="open the page in the browser")
    view.add_argument(
        *("-o", "--output", "--export"),
        type=Path,
        metavar="FILE",
        help="write the page as one .html file, and serve nothing",
    )
    view.add_argument(
        "--field",
        action="append",
        type=_field,
        default=[],
        metavar="NAME",
        help="with --export: a field in the file, or a component such as stress:mises; may be repeated (default:"
        " damage, in models of diffusion what diffuses, displacement and energy)",
    )
    view.add_argument(
        "--megabytes",
        type=positive,
        metavar="N",
        help="with --export: the most numbers in the file, before compression; of larger runs some nodes are left out"
        " (default: 32)",
    )
    add_every(view)
    view.add_argument("--force", action="store_true", help="overwrite the file if it exists")
    view.add_argument(
        "--json", action="store_true", help="print the address, or what is in the file, as JSON on stdout"
    )
    view.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors and warnings")
    view.set_defaults(run=_view)


def _port(text: str) -> int:
    """A port, as an option's type."""
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"cannot use '{text}'; use a whole number from 1 to 65535")
    return int(text)


def _field(text: str) -> tuple[str, str]:
    """The name and the component of a field, "" for its default, as an option's type."""
    name, _, part = text.partition(":")
    if name not in FIELDS:
        raise argparse.ArgumentTypeError(f"field '{name}' is unknown; use one of {', '.join(FIELDS)}")
    return name, part


def _view(args: argparse.Namespace) -> int:
    from pdsolve.results import Results

    if args.output is None:
        for name in OF_EXPORT:
            if getattr(args, name):
                raise commandline.UsageError(
                    f"--{name} says what is in a file; give --export FILE too, or leave it out"
                )
        return _serve(args)
    if args.port or args.open:
        raise commandline.UsageError("--export serves nothing; leave out --port and --open")
    path = commandline.output_path(args.output, args.results, ".html", args.force)
    with Results.open(args.results) as results:
        return _export(args, results, path)


def _serve(args: argparse.Namespace) -> int:
    from pdpost.browser.server import PageServer

    try:
        server = PageServer(args.results, args.port)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        raise commandline.UsageError(f"--port: cannot listen on {args.port}: {reason}; use another port") from None
    with server:
        server.prepare()
        lines = [f"{args.results}: {server.address} (Ctrl-C ends it)"]
        commandline.report({"results": str(args.results), "address": server.address}, lines, args)
        if args.open:
            import webbrowser

            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:  # the usual end
            commandline.note("", args)
    return commandline.OK


def _export(args: argparse.Namespace, results: Results, path: Path) -> int:
    from pdmesh.files import write_atomically
    from pdpost.browser import page

    stride = chosen_stride(results, args) if args.every or args.stride else None
    chosen: Selection = page.select(results, stride, args.field, args.megabytes or page.LIMIT)
    text = page.offline_page(results, args.results.stem, chosen, counted(args, "writing")).encode()
    write_atomically(path, text)
    names = [name + f":{part}" * (part != "value") for name, part in chosen.fields]
    counts = {"frames": len(chosen.steps), "nodes": chosen.nodes, "fields": names, "left_out": chosen.left_out}
    line = f"{path}: {len(chosen.steps)} frames of {', '.join(names)}, {chosen.nodes} nodes, {len(text) / 1e6:.3g} MB"
    line += f"; left out: {chosen.left_out}" if chosen.left_out else ""
    commandline.report({"output": str(path), "bytes": len(text), **counts}, [line], args)
    return commandline.OK
