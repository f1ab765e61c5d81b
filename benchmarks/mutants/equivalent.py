"""Changes that change nothing anybody could notice: file, line, what a piece of it becomes; the reason beside each."""

EQUIVALENT: dict[tuple[str, str, str], str] = {
    (
        "pdmesh/scene/shapes.py",
        "sagitta = float(np.clip(CHORD_TOLERANCE * spacing / self.radius, 1e-15, 0.25))",
        "(2e-15)",
    ): "a floor against a division by zero, of circles 1e13 times as wide as a spacing",
    (
        "pdpost/figures/style.py",
        "if drawn.width <= room:",
        "(drawn.width < room)",
    ): "a figure that is exactly as wide as there is room is drawn once more, and as wide",
}
