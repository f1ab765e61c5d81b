"""How long a run took, and on what, in words."""

from __future__ import annotations

from typing import Any

SHOWN = 0.5  # s of compiling that are worth a word


def wall_time_text(summary: dict[str, Any], method_text: str | None = None) -> str:
    """The wall time in the summary of a run, what it ran on, and `method_text`, by default at what speed."""
    if method_text is None:
        millions = summary["bond_updates_per_second"] / 1e6
        method_text = f" {millions:.0f} million directed bond updates a second ({summary['kernel']})"
    compiled = summary.get("compile_time", 0.0)  # files of earlier releases have none
    apart = f"; compiled kernels for {compiled:.0f} s" if compiled >= SHOWN else ""
    device = str(summary["device"])
    if device == "cpu":
        device = f"{summary['threads']} thread{'s' if summary['threads'] > 1 else ''}"
    return f"wall time {summary['wall_time']:.2f} s on {device},{method_text}{apart}"
