"""Draws the figure of docs/how_to/view.md: the page of `pdpost view` in a headless Chromium. Writes docs/view.png."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
SCENE = [
    str(ROOT / "geometries" / "duran50.geo"),
    "--set",
    "Zones/fine/Spacing=5e-4",
    "--set",
    "Zones/coarse/Spacing=5e-4",
]
LOADS = ["--set", "Loads/top/Traction y=18e6", "--set", "Loads/bottom/Traction y=-18e6"]
SIZE = 1280, 960
CHROMIUM = "--headless --disable-gpu --disable-quic --no-first-run --disable-background-networking --disable-sync"
WEBGL = "--use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars --virtual-time-budget=20000"


def main() -> int:
    """Solve the plate, export its page and take a screenshot."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        print("Chromium is missing; on Debian and Ubuntu: apt-get install chromium", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        for program, *words in (
            ("pdmesh", "build", *SCENE, *LOADS, "-o", "duran50.json"),
            ("pdsolve", "duran50.json"),
            ("pdpost", "view", "duran50.sqlite", "--export", "duran50.html"),
        ):
            subprocess.run([sys.executable, "-m", program, *words, "-q"], cwd=folder, check=True)
        words = [
            *CHROMIUM.split(),
            *WEBGL.split(),
            f"--user-data-dir={folder}/profile",
            *["--no-sandbox"] * (not os.geteuid()),
        ]
        page = (Path(folder) / "duran50.html").as_uri()
        size, picture = f"--window-size={SIZE[0]},{SIZE[1]}", Path(folder) / "view.png"
        subprocess.run([browser, *words, size, f"--screenshot={picture}", page], check=True, capture_output=True)
        with Image.open(picture) as image:
            image.convert("RGB").save(ROOT / "docs" / "view.png", optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
