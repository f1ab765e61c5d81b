"""Changes that change nothing anybody could notice: file, line, what a piece of it becomes; the reason beside each."""

EQUIVALENT: dict[tuple[str, str, str], str] = {}
