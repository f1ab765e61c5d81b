"""Faults of all kinds for as long as there is time: `make endurance`, or python -m benchmarks.endurance --minutes 15.

Writes docs/developers/endurance.md: what was tried, what was lost, what ended in a traceback, what came out wrong,
and what did not fit into the time. All of it happens in a scratch folder.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from benchmarks.endured import Part, Until, corruptions, forgeries, full_disks, kills, many_frames, order
from benchmarks.endured_studies import scheduled, studies
from benchmarks.endured_together import caches, large, readers
from benchmarks.endured_variables import variables
from benchmarks.kills import ROOT
from benchmarks.pages import markdown_table, read_block, write_block
from pdmesh import VERSION

LANES: tuple[dict[str, tuple[float, Callable[[Path, Until], Part]]], ...] = (
    # parts that are tried one after the other, beside those of the others, each with its share of the time
    {"kills at calls, all kinds of run": (1.0, kills), "files of each kind, corrupted": (0.45, corruptions)},
    {
        "a study of 500 runs, killed": (0.5, studies),
        "a study by a scheduler, killed": (0.15, scheduled),
        "two processes, one compile cache": (0.15, caches),
        "hostile variables": (0.3, variables),
    },
    {
        "forged side files and studies": (0.25, forgeries),
        "50 readers beside a writer": (0.1, readers),
        "nodes in another order": (0.1, order),
        "full disks": (0.1, full_disks),
        "2000 frames": (0.1, many_frames),
        "2 million nodes, Ctrl-C": (0.5, large),
    },
)
PARTS = {name: part for lane in LANES for name, part in lane.items()}
PAGE = ROOT / "docs" / "developers" / "endurance.md"


def limit(end: float) -> Until:
    """Whether so many seconds are left until `end`."""
    return lambda seconds: time.monotonic() + seconds < end


def block(parts: dict[str, tuple[Part, float]], minutes: float) -> str:
    """The block of the page."""
    rows = [
        [name, f"{part.tried} of {part.of}", part.lost, part.traces, part.wrong, f"{seconds / 60:.1f}", part.note]
        for name, (part, seconds) in parts.items()
    ]
    sums = [sum(getattr(part, count) for part, _ in parts.values()) for count in ("tried", "lost", "traces", "wrong")]
    rows.append(["all", *sums, f"{sum(seconds for _, seconds in parts.values()) / 60:.1f}", ""])
    return (
        f"Written by `make endurance` (here `python -m benchmarks.endurance --minutes {minutes:g}`), version {VERSION},"
        f" {os.cpu_count()} cores, Python {platform.python_version()}.\n\n"
        + markdown_table(["what", "tried", "lost", "tracebacks", "wrong", "minutes", "found"], rows)
    )


ROW = re.compile(r"\| (.+) \| (\d+) of (\d+) \| (\d+) \| (\d+) \| (\d+) \| ([\d.]+) \| (.*) \|")


def known(text: str) -> dict[str, tuple[Part, float]]:
    """What a page says of each part."""
    parts = {}
    for name, *counts, minutes, note in ROW.findall(text):
        if name in PARTS:
            parts[name] = Part(*map(int, counts), note), 60 * float(minutes)
    return parts


def tried(names: Iterable[str], minutes: float) -> Iterator[tuple[str, Part, float]]:
    """Try parts, one after the other: their names, what came of them, and seconds."""
    chosen = {name: PARTS[name] for name in names}
    end, rest = time.monotonic() + 60 * minutes, sum(share for share, _ in chosen.values())
    with tempfile.TemporaryDirectory(prefix="endurance-", ignore_cleanup_errors=True) as scratch:
        for name, (share, work) in chosen.items():
            began = time.monotonic()
            until = limit(began + (end - began) * share / rest)  # what others have left over is shared
            rest -= share
            folder = Path(scratch) / "part"
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            try:
                part = work(folder, until)
            except Exception:
                traceback.print_exc()
                part = Part(0, 1, traces=1, note="ended with a traceback")
            print(f"{name}: {part}", file=sys.stderr, flush=True)
            yield name, part, time.monotonic() - began


def side_by_side(minutes: float) -> Iterator[tuple[str, Part, float]]:
    """Try all parts, in some processes beside each other: most of them wait for one process, or for the disk."""
    words = [sys.executable, "-m", "benchmarks.endurance", "--minutes", str(minutes)]
    lanes = [[*words, *(word for name in lane for word in ("--part", name))] for lane in LANES]
    children = [subprocess.Popen(lane, cwd=ROOT, stdout=subprocess.PIPE, text=True) for lane in lanes]
    for lane, child in zip(LANES, children, strict=True):
        lines = child.communicate()[0].splitlines()
        parts = {name: (Part(*part), seconds) for name, part, seconds in map(json.loads, lines)}
        for name in lane:
            part, seconds = parts.get(name, (Part(0, 1, traces=1, note=f"ended with {child.returncode}"), 0.0))
            yield name, part, seconds


def main(arguments: list[str]) -> int:
    """Try all parts, write the page; 1 where anything fell."""
    program = argparse.ArgumentParser(description="Try what runs endure, and write docs/developers/endurance.md.")
    program.add_argument("--minutes", type=float, default=55.0, help="how long there is (default: 55)")
    program.add_argument("--part", choices=PARTS, action="append", help="this part alone; the page is not written")
    program.add_argument("--again", action="store_true", help="write what came of --part into the page that is there")
    args = program.parse_args(arguments)
    warnings.simplefilter("ignore")
    parts = {}
    for name, part, seconds in tried(args.part, args.minutes) if args.part else side_by_side(args.minutes):
        parts[name] = part, seconds
        if args.part:
            print(json.dumps([name, part, seconds]), flush=True)
    if args.again or not args.part:
        before = known(read_block(PAGE, "parts")) if args.again else {}
        write_block(PAGE, "parts", block(before | parts, args.minutes))
        print(PAGE)
    return int(any(part.lost or part.traces or part.wrong for part, _ in parts.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
