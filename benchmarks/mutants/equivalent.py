"""Changes that change nothing anybody could notice: file, line, what a piece of it becomes; the reason beside each."""

EQUIVALENT: dict[tuple[str, str, str], str] = {
    ("pdmesh/grid/cell_areas.py", "shapely.prepare(around)", "pass"): "prepared geometries are only faster",
    (
        "pdsolve/operators/space_lattice/sites.py",
        "OFF_PLACE = 1e-6  # spacings: how far a node may be from its place in the lattice",
        "(2e-06)",
    ): "round-off of places is 1e-12, and what is no lattice is off by far more",
    (
        "pdmesh/scene/shapes.py",
        "sagitta = float(np.clip(CHORD_TOLERANCE * spacing / self.radius, 1e-15, 0.25))",
        "(2e-15)",
    ): "a floor against a division by zero, of circles 1e13 times as wide as a spacing",
    (
        "pdpost/figures/style.py",
        "if bounds.width <= room:",
        "(bounds.width < room)",
    ): "a figure that is exactly as wide as there is room is drawn once more, and as wide",
    ("pdsolve/__main__.py", "gc.disable()", "pass"): "garbage is collected while nothing is garbage: only slower",
    ("pdsolve/__main__.py", "gc.enable()", "pass"): "cycles that a run leaves are no memory that anybody sees",
    (
        "pdsolve/schemes/separation_energy.py",
        "crossing, opening = int((middle[source] & (upper[source] != upper[target])).sum()), FIRST",
        "(upper[source] == upper[target])",
    ): "all bonds are broken before the openings end: it only takes longer to see",
    (
        "pdsolve/crack_growth/growth.py",
        "if radius >= least:",
        "(radius > least)",
    ): "room that is the least to the last bit",
    ("pdsolve/operators/protocol.py", "def broken(self, after: int = 0) -> Broken:", "(1)"): "a protocol has no code",
    (
        "pdpost/reading/watching.py",
        "continue",
        "pass",
    ): "a run that has just written a frame is looked at again after a wait, not at once",
}
