"""What a crack through a body in space costs in a run: halves of a block are moved apart, bonds break one by one."""

from __future__ import annotations

import msgspec
import pytest
from separated_blocks import parted

from pdmesh import Material

GLASS = Material(E=65e9, rho=2235.0, G0=204.0, plane="space", micromodulus="constant")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "layers", "narrow", "far"),
    [  # at free sides bonds are fewer, so that what a block costs rises with its width; `far` is without sides
        ("bond", 16, 0.952, 1.0),  # measured 0.9524, 0.9948; of the bare sum over the lattice 0.992
        ("ordinary", 8, 0.765, 0.98),  # measured 0.7646, 0.9823
        ("correspondence", 8, 0.848, 1.0),  # measured 0.8475, 0.9967: torn families at sides are bounded
    ],
)
def test_a_crack_costs_G0(model: str, layers: int, narrow: float, far: float) -> None:
    nu, failure = (0.25, "stretch") if model == "bond" else (0.3, "energy" if model == "ordinary" else "stretch")
    material = msgspec.structs.replace(GLASS, model=model, nu=nu, failure=failure)
    over = []
    for wide in (8, 16):
        results, area = parted(material, wide, layers)
        breaks, nodes = results.breaks(), results.nodes()
        assert (nodes.position[breaks.node - 1, 2] * nodes.position[breaks.neighbour - 1, 2] < 0).all()
        over.append(results.history()[-1]["dissipated"] / (material.G0 * area))
    assert over[0] == pytest.approx(narrow, abs=0.005)
    assert 2 * over[1] - over[0] == pytest.approx(far, abs=0.01)  # what sides lack goes as 1 / width
