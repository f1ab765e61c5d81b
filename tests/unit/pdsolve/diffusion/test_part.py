"""The operator of a part of the nodes has the rates of the whole, bit by bit."""

from __future__ import annotations

import diffusion_models
import msgspec
import numpy as np
import pytest

from pdmesh.model.document import Concentration, MediumRegion, Run
from pdmesh.model.medium import Medium
from pdsolve.diffusion.system import prepare

CORRECTED = Medium(D=1.0, surface_correction=True)
KINETIC = msgspec.structs.replace(diffusion_models.CORRODING, dissolution="kinetic")


OTHER = (MediumRegion(box=(0.1, -2.0, 2.0, 2.0), D=0.3),)


@pytest.mark.parametrize(
    ("medium", "kernel", "media"),
    [(CORRECTED, "lattice", ()), (CORRECTED, "lattice", OTHER), (CORRECTED, "listed", ()), (KINETIC, "listed", ())],
)
def test_rows_of_a_part_have_the_rates_of_the_whole(
    medium: Medium, kernel: str, media: tuple[MediumRegion, ...]
) -> None:
    position = diffusion_models.lattice(0.05, 1.0, 2)
    held = Concentration(nodes=diffusion_models.ids(position[:, 0] > 0.8), value=0.1)
    model = diffusion_models.model(position, 0.05, medium, conditions=(held,), media=media, run=Run(steps=1))
    transport, state = prepare(model, listed=kernel == "listed")
    whole = transport.operator
    assert whole.name == kernel
    rng, nodes = np.random.default_rng(1), len(position)
    state.value[:, 0], whole.solid = rng.uniform(0.0, 0.3, nodes), rng.integers(0, 2, nodes).astype(np.uint8)
    whole.outside = rng.uniform(0.0, 1.0, nodes)
    whole._open = True
    out = np.zeros((nodes, 1))
    first, last = 320, 704
    far = np.abs(position[:, None, 1] - position[None, first:last, 1]).min(axis=1) < 0.3
    begin, end = int(far.argmax()), nodes - int(far[::-1].argmax())
    assert 0 < begin < first < last < end < nodes
    part = whole.part(first, last, begin, end)
    if kernel == "lattice":
        sites = part.exchange.sites
        assert sites.size == part.exchange.tiles.D.shape[1] < whole.exchange.sites.size
        assert sites.node[sites.site - sites.margin].tolist() == list(range(end - begin))
        assert np.count_nonzero(sites.node >= 0) == end - begin
    whole.accumulate_force(state, out, 1, 1e-3)
    window, found = type(state)(*(values[begin:end].copy() for values in state)), np.zeros((end - begin, 1))
    window.work[:] = 0
    part.accumulate_force(window, found, 1, 1e-3)
    own = slice(first - begin, last - begin)
    assert found[own].tobytes() == out[first:last].tobytes()
    assert np.abs(out[first:last]).min() > 0
    assert not found[: own.start].any()
    assert not found[own.stop :].any()
    assert window.work[own].tobytes() == state.work[first:last].tobytes()
    assert part.solid[own].tobytes() == whole.solid[first:last].tobytes()
