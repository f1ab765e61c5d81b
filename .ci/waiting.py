"""Runs a command and counts its seconds: `python3 .ci/waiting.py "reading the drawing" COMMAND ...`.

On a terminal the line changes each second; elsewhere it is written once, with the time when the command ends.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time


def main() -> int:
    """Run the command; returns its exit code."""
    what, *command = sys.argv[1:]
    began = time.monotonic()
    shows = sys.stderr.isatty()
    if not shows:
        print(f"{what} ...", file=sys.stderr, flush=True)
    process = subprocess.Popen(command)
    try:
        while True:
            try:
                code = process.wait(1.0)
                break
            except subprocess.TimeoutExpired:
                if shows:
                    print(f"\r{what}: {time.monotonic() - began:.0f} s", end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        return process.wait() or 130
    clear = "\r" if shows else ""
    print(f"{clear}{what}: {time.monotonic() - began:.1f} s", file=sys.stderr, flush=True)
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    os.environ.setdefault("PYTHONUNBUFFERED", "1")
    sys.exit(main())
