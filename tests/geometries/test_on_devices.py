"""Shipped scenes on an OpenCL device: the same bits as on the processor, while much of them breaks."""

from __future__ import annotations

import numpy as np
import pytest
from devices import needs_opencl
from plates import shipped
from system_checks import broken

from benchmarks.compare import weakened
from pdsolve.model import Model, ModelError, on_device
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

pytestmark = [needs_opencl, pytest.mark.slow]
PLATES = (
    "duran50.geo",
    "soda_lime.geo",
    "duran50_one_scale.py",
    "soda_lime_one_scale.py",
    "kalthoff_winkler.geo",
    "kalthoff_winkler_steel.py",
    "oblique_crack.geo",
    "plate_with_hole.geo",
    "v_notch.geo",
    "figure_18.geo",
    "figure_19.py",
    "strip.py",
)
BODIES = "penny.geo", "branching_block.py", "kalthoff_winkler_block.py", "slanted_notch.py", "expanding_ring.py"
TOUGH = ("slanted_notch.py",)  # of which nothing breaks so soon
SHAKEN = 2e-5  # spacings, the displacement of nodes at random from which bonds of a hundredth of the toughness break


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("scene", [*PLATES, *BODIES])
def test_a_scene(scene: str, precision: str) -> None:
    built = shipped(scene)
    model = Model(built.grid, weakened(built.settings, "as shipped", 0.01))
    options = Options("conservative", precision, threads=1)
    here, there = (prepare(one, options) for one in (model, on_device(model, "opencl")))
    for problem in (here, there):
        random = np.random.default_rng(1)
        shape = problem.state.value.shape
        problem.state.value[:] = SHAKEN * model.grid.delta[:, None] * random.standard_normal(shape)
        problem.advance(1, 2)
        problem.advance(2, 12)
    assert there.system.stepper.device_name != "cpu"
    assert (len(broken(here).step) > 0) == (scene not in TOUGH)
    assert all(map(np.array_equal, here.state, there.state))
    assert all(map(np.array_equal, broken(here), broken(there)))


@pytest.mark.parametrize("scene", ["bar.py", "forked_crack.py", "kalthoff_winkler_projectile.py", "duran_metre.py"])
def test_what_a_scene_wants_more(scene: str) -> None:
    """Correspondence, cracks of particles, contact, fine zones: refused in one line."""
    built = shipped(scene)
    with pytest.raises(ModelError) as caught:
        prepare(on_device(Model(built.grid, built.settings), "opencl"), Options())
    assert "device" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_disc_that_dissolves_in_equilibrium() -> None:
    """The shipped disc with the enthalpy method: contents of ten steps."""
    built = shipped("disc.geo", (("Zones/liquid/Spacing", "0.1"),))
    model = Model(built.grid, built.settings)
    here, there = (prepare(one, Options(threads=1)) for one in (model, on_device(model, "opencl")))
    for problem in (here, there):
        problem.advance(1, 11)
    assert all(map(np.array_equal, here.state, there.state))
