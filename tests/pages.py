"""What users are told: the README, and the pages of the guide."""

from __future__ import annotations

from plates import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
GUIDE = {page.stem: page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs" / "guide").glob("*.md"))}
TOLD = "\n".join([README, *GUIDE.values()])
