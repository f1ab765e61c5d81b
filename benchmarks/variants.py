"""Ways to solve a problem: the usual one, and others that differ from it in one thing or two."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import msgspec

from pdmesh.model.document import Horizon
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.assembly import system_of
from pdsolve.run.prepare import prepare
from pdsolve.run.system import Prepared
from pdsolve.schemes import SCHEMES, average_horizon
from pdsolve.schemes.average_horizon import ALL, Corrections
from pdsolve.schemes.scheme import Scheme


class Variant(NamedTuple):
    """One way to solve a problem; the usual one but for what its name says."""

    name: str
    ratio: int = 2  # of the coarse spacing over the fine one; 1 for a uniform grid
    fine: float = 1.0  # the finest spacing over that of the problem
    mode: str = "conservative"
    profile: str = "conical"
    m: float = 3.0
    corrections: Corrections = ALL
    precision: str = "float64"
    step: float = 1.0  # over the surely stable one
    adapt: str = "none"  # hybrid: fine near cracks alone, a lattice of twice the spacing elsewhere
    model: str = "bond"

    def scheme(self) -> Scheme:
        """How bonds are filled."""
        usual = SCHEMES[self.mode]
        if self.corrections == ALL:
            return usual
        return usual._replace(fill=lambda model: average_horizon.fill(model, self.corrections))

    def prepared(self, model: Model) -> Prepared:
        """The model, prepared for being solved this way."""
        assert model.settings.material is not None
        material = msgspec.structs.replace(model.settings.material, micromodulus=self.profile, model=self.model)
        settings = msgspec.structs.replace(model.settings, material=material, horizon=Horizon(self.m))
        model = dataclasses.replace(model, settings=settings)
        time_step = self.step * self._filled(model).system.bound
        steps = round(settings.run.steps * (settings.run.time_step or 0) / time_step)
        wanted = msgspec.structs.replace(settings.run, steps=steps, every=max(1, steps // 20), time_step=time_step)
        model = dataclasses.replace(model, settings=msgspec.structs.replace(settings, run=wanted))
        return self._filled(model)

    def _filled(self, model: Model) -> Prepared:
        """The model with this variant's bonds."""
        options = Options(self.mode, self.precision)
        return prepare(model, options) if self.adapt != "none" else system_of(model, options, self.scheme())


BASE = Variant("the defaults")
VARIANTS = (
    BASE,
    Variant("uniform, coarse", ratio=1, fine=2.0),
    Variant("uniform, fine", ratio=1),
    Variant("ratio 4", ratio=4),
    Variant("thesis", mode="thesis"),
    Variant("thesis, m = 4", mode="thesis", m=4.0),
    Variant("constant", profile="constant"),
    Variant("m = 4", m=4.0),
    Variant("m = 6", m=6.0),
    Variant("constant, m = 4", profile="constant", m=4.0),
    Variant("uniform, fine, m = 4", ratio=1, m=4.0),
    Variant("uniform, coarse, m = 4", ratio=1, fine=2.0, m=4.0),
    Variant("constant, no partial cells", profile="constant", corrections=ALL._replace(partial_cells=False)),
    Variant("no calibration", corrections=ALL._replace(calibration=False)),
    Variant("no surface correction", corrections=ALL._replace(surfaces=False)),
    Variant("no correction", corrections=Corrections(False, False, False)),
    Variant("float32", precision="float32"),
    Variant("a quarter of the step", step=0.25),
    Variant("0.7 of the step", step=0.7),
)
CRACKED = (  # more ways to solve a problem with cracks
    *VARIANTS,
    Variant("half the spacing", fine=0.5),
    Variant("hybrid", ratio=1, adapt="hybrid"),
    Variant("hybrid, m = 4", ratio=1, adapt="hybrid", m=4.0),
    Variant("hybrid, half the spacing", ratio=1, adapt="hybrid", fine=0.5),
    Variant("hybrid, half the spacing, m = 4", ratio=1, adapt="hybrid", fine=0.5, m=4.0),
)
SIDE_BY_SIDE = tuple(  # uniform and hybrid at three spacings
    Variant(f"{adapt}, {words}", ratio=1, fine=fine, m=4.0, adapt="hybrid" if adapt == "hybrid" else "none")
    for words, fine in (("2 mm", 2.0), ("1 mm", 1.0), ("0.5 mm", 0.5))
    for adapt in ("uniform", "hybrid")
)
STATE_BASED = (  # beside bonds, where Poisson's ratio is none of theirs
    BASE,
    *(
        Variant(f"{model}, {size}, m = {m:g}", ratio=1, fine=fine, m=m, model=model)
        for model in ("bond", "ordinary", "correspondence")
        for size, fine in (("coarse", 2.0), ("fine", 1.0))
        for m in (3.0, 4.0)
    ),
)
OTHER_GRIDS = tuple(
    one.name for one in (*CRACKED, *SIDE_BY_SIDE, *STATE_BASED) if (one.ratio, one.fine) != (BASE.ratio, BASE.fine)
)
