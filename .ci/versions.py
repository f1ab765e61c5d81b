"""Lists the versions in a folder of sites, one folder each: python .ci/versions.py site.

Writes versions.json, the newest version first, which the choice on every page reads, and index.html, which leads to
the newest.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

NUMBERS = re.compile(r"\d+")


def main(folder: Path) -> None:
    """Write both files into `folder`."""
    names = [path.parent.name for path in folder.glob("*/index.html") if path.parent.name[:1].isdigit()]
    versions = sorted(names, key=lambda name: [int(number) for number in NUMBERS.findall(name)], reverse=True)
    (folder / "versions.json").write_text(json.dumps(versions) + "\n", encoding="utf-8")
    target = f"{versions[0]}/index.html"
    (folder / "index.html").write_text(
        '<!doctype html><meta charset="utf-8"><title>pdsuite</title>'
        f'<meta http-equiv="refresh" content="0; url={target}">'
        f'<p><a href="{target}">pdsuite {versions[0]}</a></p>\n',
        encoding="utf-8",
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
