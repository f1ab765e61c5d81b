"""Bonds that cross an interface: which they are, what they cost, and what is refused."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from node_clouds import cubic_grid
from plates import GLASS, plate, square_grid

from pdmesh import Material, Scene, SceneError, box, build
from pdmesh.model.cohesive_softening import largest_horizon
from pdmesh.model.document import Region, Run
from pdmesh.model.interfaces import Interface, wrong_interface
from pdmesh.model.neighbours import lengths
from pdmesh.model.node_grid import document_of
from pdsolve.bonds.assembly import Bonds
from pdsolve.bonds.interfaces import Interfaces, cut_of_springs
from pdsolve.estimate import estimate_run
from pdsolve.model import Model, ModelError, ModelWarning, model_of
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.schemes import SCHEMES

COHESIVE = msgspec.structs.replace(GLASS, law="cohesive", f_t=20e6)


def bonds_of(model: Model) -> Bonds:
    return SCHEMES["conservative"].fill(model).whole().bonds


def two_halves(material: Material = GLASS, ratio: float = 3, **interface: Any) -> tuple[Model, Model]:
    """A plate whose upper half is a region, with an interface of these constants and without."""
    grid = square_grid(11, 12)
    upper = Region(name="upper", nodes=tuple(grid.ids[grid.position[:, 1] > 5.5e-3].tolist()), material=material)
    weak = Interface(between=("rest", "upper"), **interface)
    return (
        plate(grid, ratio, material=material, regions=(upper,), interfaces=(weak,)),
        plate(grid, ratio, material=material, regions=(upper,)),
    )


def across(model: Model, bonds: Bonds) -> np.ndarray:
    upper = model.grid.position[:, 1] > 5.5e-3
    return np.asarray(upper[bonds.source] != upper[bonds.neighbour])


def cost_of_cut(angle: float, ratio: float, drawn: bool, **material: Any) -> float:
    """Energy of the bonds across a straight interface at an angle, over its G0 and length; spacing 1, 53 x 53 nodes."""
    half, off, G0 = 26, 0.31, 2.0
    grid = square_grid(2 * half + 1, 2 * half + 1, 1.0, -half, -half)
    turn = np.radians(angle)
    along, normal = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    above = grid.position @ normal > off
    one = msgspec.structs.replace(Material(E=1e9, rho=1.0, G0=10.0), **material)
    if drawn:
        ends = [*(off * normal - 10 * half * along), *(off * normal + 10 * half * along)]
        model = plate(grid, ratio, material=one, interfaces=(Interface(faces=(tuple(ends),), G0=G0),))
    else:
        region = Region(name="a", nodes=tuple(grid.ids[above].tolist()), material=one)
        weak = Interface(between=("a", "rest"), G0=G0)
        model = plate(grid, ratio, material=one, regions=(region,), interfaces=(weak,))
    bonds, width = bonds_of(model), half - 9.75  # middles of bonds are half a spacing apart along an axis
    i, j = bonds.source, bonds.neighbour
    place = (grid.position[i] + grid.position[j]) @ along / 2
    crossing = (above[i] != above[j]) & (np.abs(place) <= width)
    energy = bonds.stiffness * np.hypot(*bonds.xi.T) * bonds.peak * bonds.limit / 4
    return float(energy[crossing].sum() / (2 * width * G0))


@pytest.mark.parametrize("drawn", [False, True])
@pytest.mark.parametrize("angle", [10.0, *(pytest.param(a, marks=pytest.mark.slow) for a in (0.0, 20.0, 26.57, 45.0))])
def test_an_oblique_cut_costs_the_toughness_of_the_interface(angle: float, drawn: bool) -> None:
    """Without the correction by the angle it is 3 % more at 10 degrees."""
    assert cost_of_cut(angle, 3, drawn) == pytest.approx(1, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "profile"), [(2, "conical"), (3, "constant"), (4, "conical")])
def test_it_does_so_with_other_horizons(ratio: float, profile: str) -> None:
    """8.5 % more without the correction, with a horizon of 2 spacings."""
    for angle in (0.0, 20.0, 35.0, 45.0):
        assert cost_of_cut(angle, ratio, False, micromodulus=profile) == pytest.approx(1, abs=0.03)
        assert cost_of_cut(angle, ratio, True, micromodulus=profile) == pytest.approx(1, abs=0.015)


def test_only_bonds_across_it_have_its_toughness() -> None:
    """The stretch at which they break falls with the root of G0, and no other bond changes."""
    weak, plain = two_halves(G0=GLASS.G0 / 4)
    bonds, usual = bonds_of(weak), bonds_of(plain)
    crossing = across(weak, bonds)
    assert 0 < crossing.sum() < len(crossing)
    assert np.array_equal(bonds.limit[~crossing], usual.limit[~crossing])
    assert bonds.limit[crossing] == pytest.approx(usual.limit[crossing] / 2, rel=0.02)  # normals turn at edges
    assert np.array_equal(bonds.stiffness, usual.stiffness)


def test_a_strength_and_a_stiffness_are_those_of_its_bonds() -> None:
    """Energy is scaled with them: a softer bond breaks at a larger stretch."""
    weak, plain = two_halves(COHESIVE, f_t=10e6)
    bonds, usual = bonds_of(weak), bonds_of(plain)
    crossing = across(weak, bonds)
    assert bonds.peak[crossing] == pytest.approx(usual.peak[crossing] / 2)
    assert np.array_equal(bonds.peak[~crossing], usual.peak[~crossing])
    soft, plain = two_halves(stiffness=0.25)
    bonds, usual = bonds_of(soft), bonds_of(plain)
    assert bonds.stiffness[crossing] == pytest.approx(usual.stiffness[crossing] / 4)
    assert bonds.limit[crossing] == pytest.approx(2 * usual.limit[crossing], rel=0.02)
    assert np.array_equal(bonds.stiffness[~crossing], usual.stiffness[~crossing])


@pytest.mark.parametrize("case", [{"failure": "stretch"}, {"failure": "energy"}])
def test_families_have_it(case: dict[str, str]) -> None:
    solid = msgspec.structs.replace(GLASS, model="ordinary", nu=0.2, **case)  # type: ignore[arg-type]
    weak, plain = two_halves(solid, G0=GLASS.G0 / 4)
    bonds, usual = bonds_of(weak), bonds_of(plain)
    crossing = across(weak, bonds)
    factor = 1 / 2 if case["failure"] == "stretch" else 1 / 4
    assert bonds.limit[crossing] == pytest.approx(factor * usual.limit[crossing], rel=0.04)  # likewise
    assert np.array_equal(bonds.limit[~crossing], usual.limit[~crossing])


def test_a_node_on_a_drawn_line_is_on_one_side() -> None:
    """The line through a row of nodes cuts as many bonds as one between rows; it ends where it is drawn."""
    grid = square_grid(11, 12)
    counts = []
    for y, end in ((5e-3, 1.0), (4.5e-3, 1.0), (4.5e-3, 4.5e-3)):
        weak = Interface(faces=((-1.0, y, end, y),), G0=1.0)
        counts.append(int((bonds_of(plate(grid, 3, interfaces=(weak,))).limit < 1e-4).sum()))
    assert counts[0] == counts[1] > 0
    assert 0.3 < counts[2] / counts[1] < 0.6


def test_the_weaker_line_and_the_last_pair_of_regions_count() -> None:
    model, _ = two_halves(G0=8.0)
    line = Interface(faces=((-1.0, 5.5e-3, 1.0, 5.5e-3),), G0=2.0)
    stronger = msgspec.structs.replace(line, G0=50.0)
    any_other = Interface(between=("*", "upper"), G0=4.0)
    limits = []
    for interfaces in (model.settings.interfaces, (line, *model.settings.interfaces, stronger), (any_other,)):
        settings = msgspec.structs.replace(model.settings, interfaces=interfaces)
        bonds = bonds_of(Model(model.grid, settings))
        limits.append(bonds.limit[across(model, bonds)])
    assert limits[1] == pytest.approx(limits[0] / 2, rel=0.02)
    assert limits[2] == pytest.approx(limits[0] / np.sqrt(2))


def test_in_space_a_triangle_is_a_face() -> None:
    grid = cubic_grid(6)
    height = float(np.median(grid.position[:, 2]))
    far = 1e3 * height
    triangle = (-far, -far, height, far, -far, height, 0.0, far, height)
    bonds = bonds_of(plate(grid, 3, interfaces=(Interface(faces=(triangle,), G0=GLASS.G0 / 4),)))
    usual, above = bonds_of(plate(grid, 3)), grid.position[:, 2] > height
    crossing = above[bonds.source] != above[bonds.neighbour]
    assert bonds.limit[crossing] == pytest.approx(usual.limit[crossing] / 2, rel=0.01)  # a row costs 0.987 G0
    assert np.array_equal(bonds.limit[~crossing], usual.limit[~crossing])


def test_a_scene_and_its_file_hold_it() -> None:
    scene = Scene(box(0, 0, 0.02, 0.02), 1e-3, GLASS, run=Run(steps=2)).region(box(0, 0, 0.02, 0.0105), GLASS, "lower")
    assert b"interfaces" not in msgspec.json.encode(build(scene).settings.interfaces)
    assert "interfaces" not in Model(build(scene).grid, build(scene).settings).to_json()
    built = build(
        scene.interface(("lower", "rest"), G0=20.0).interface(along=[(0, 0), (0.01, 0.01), (0.02, 0)], G0=5.0)
    )
    between, along = built.settings.interfaces
    assert between.between == ("lower", "rest")
    assert along.faces == ((0.0, 0.0, 0.01, 0.01), (0.01, 0.01, 0.02, 0.0))
    model = Model(built.grid, built.settings)
    assert model_of(model.to_json(), "model").settings == model.settings
    assert document_of(built.grid, built.settings).interfaces == (between, along)


@pytest.mark.parametrize(
    ("interface", "said"),
    [
        (
            {"between": ("upper", "lwoer"), "G0": 1.0},
            ".between[1]: no region is called 'lwoer'; use one of upper, rest, *",
        ),
        ({"G0": 1.0}, ": neither or both of between and faces are given"),
        ({"between": ("upper", "rest")}, ": none of G0, f_t and stiffness is given"),
        ({"faces": ((0.0, 0.0, 0.0, 0.0),), "G0": 1.0}, ".faces[0]: two corners are in one place"),
        ({"faces": ((0.0,) * 9,), "G0": 1.0}, ".faces[0] has 9 numbers; use a segment"),
        ({"between": ("upper", "upper"), "G0": 1.0}, ".between: no bond goes from 'upper' to another 'upper'"),
        ({"between": ("rest", "rest"), "G0": 1.0}, ".between: no bond goes from 'rest' to another 'rest'"),
    ],
)
def test_bad_ones_are_refused(interface: dict[str, Any], said: str) -> None:
    model, _ = two_halves(G0=1.0)
    with pytest.raises(ModelError, match=r"\$") as error:
        Model(model.grid, msgspec.structs.replace(model.settings, interfaces=(Interface(**interface),)))
    assert str(error.value).startswith(f"model: $.interfaces[0]{said}")


@pytest.mark.parametrize("wrong", [{"stiffness": np.inf}, {"f_t": np.nan}, {"faces": ((0.0, 0.0, np.nan, 1.0),)}])
def test_numbers_that_are_not_finite_are_refused(wrong: dict[str, Any]) -> None:
    interface = Interface(**{"faces": ((0.0, 0.0, 1.0, 1.0),), "G0": 1.0, **wrong})
    said = wrong_interface(interface, (), 2)
    assert said is not None
    assert said.startswith(f".{next(iter(wrong))}")
    assert "finite" in said


def test_a_triangle_without_area_is_refused() -> None:
    line = (0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 3.0, 3.0, 3.0 + 1e-12)
    with pytest.raises(ModelError, match=r"interfaces\[0\].faces\[0\]: its corners are on one line"):
        plate(cubic_grid(4), 3, interfaces=(Interface(faces=(line,), G0=1.0),))


@pytest.mark.parametrize("constants", [{"G0": 2.04}, {"stiffness": 0.01}, {"f_t": 200e6}])
def test_cohesive_bonds_that_hold_more_than_their_toughness_are_refused(constants: dict[str, float]) -> None:
    model, _ = two_halves(COHESIVE, **constants)
    with pytest.raises(ModelError, match=r"\$\.interfaces\[0\]"):
        prepare(model, Options(threads=1))


def test_they_are_refused_by_the_dearest_direction() -> None:
    """2 % more than a cut along a row needs is too little, as an oblique cut costs 5 % more; 6 % is enough."""
    enough_along_a_row = COHESIVE.G0 * 3e-3 / largest_horizon(COHESIVE, 3)
    refused, _ = two_halves(COHESIVE, G0=1.02 * enough_along_a_row)
    with pytest.raises(ModelError, match=r"\$\.interfaces\[0\]"):
        prepare(refused, Options(threads=1))
    model, _ = two_halves(COHESIVE, G0=1.06 * enough_along_a_row)
    prepare(model, Options(threads=1))
    bonds = bonds_of(model)
    assert (bonds.limit > bonds.peak).all()


def test_the_dearest_cut_costs_what_the_lattice_says() -> None:
    costs = [cut_of_springs(COHESIVE, ratio).largest_cost() for ratio in (2, 3)]
    assert costs == pytest.approx([1.0824, 1.0504], abs=3e-4)


def test_one_that_no_bond_crosses_is_told() -> None:
    """Lines in mm and regions that do not touch; those that bonds cross are not told."""
    grid = square_grid(11, 12)
    height = grid.position[:, 1]
    ends = {"lower": height < 1.5e-3, "upper": height > 9.5e-3}
    regions = tuple(Region(name=k, nodes=tuple(grid.ids[at].tolist()), material=GLASS) for k, at in ends.items())
    crossed = (
        Interface(between=("lower", "rest"), G0=1.0),
        Interface(between=("*", "*"), G0=1.0),
        Interface(faces=((-1.0, 5e-3, 1.0, 5e-3),), G0=1.0),
    )
    missed = (
        Interface(name="far", between=("lower", "upper"), G0=1.0),
        Interface(name="mm", faces=((0.0, 5.0, 10.0, 5.0),), G0=1.0),
    )
    model = plate(grid, 3, regions=regions, interfaces=(*crossed, *missed))
    with pytest.warns(ModelWarning) as warned:
        estimate_run(model, Options(threads=1))
    said = [str(each.message) for each in warned if "crosses no bond" in str(each.message)]
    assert [line.split("'")[1] for line in said] == ["far", "mm"]
    assert "$.interfaces[3]" in said[0]


def test_costs_do_not_depend_on_what_they_are_asked_with() -> None:
    normal = np.random.default_rng(1).normal(size=(300, 2))
    normal /= np.hypot(*normal.T)[:, None]
    cut = cut_of_springs(GLASS, 3)
    assert cut.cost(normal).tolist() == [float(cut.cost(-one[None])[0]) for one in normal]


def test_round_off_is_no_normal() -> None:
    """A layer of one row, as far from one side as from the other: its nodes have no direction of their own."""
    grid = square_grid(21, 21)
    middle = np.abs(grid.position[:, 1] - grid.position[:, 1].mean()) < 1e-9
    layer = Region(name="layer", nodes=tuple(grid.ids[middle].tolist()), material=GLASS)
    model = plate(grid, 3, regions=(layer,), interfaces=(Interface(between=("layer", "rest"), G0=1.0),))
    size = lengths(Interfaces(model)._normals)
    assert np.all((size == 0) | (np.abs(size - 1) < 1e-9))
    assert not size[middle][3:-3].any()
    assert size[~middle].max() == pytest.approx(1)


def test_constants_that_bonds_do_not_have_are_refused() -> None:
    for material, key, values in (
        (GLASS, "f_t", {"f_t": 1e6}),
        (msgspec.structs.replace(GLASS, model="ordinary", nu=0.2), "stiffness", {"stiffness": 0.5}),
        (msgspec.structs.replace(GLASS, model="ordinary", nu=0.2, failure="none"), "G0", {"G0": 1.0}),
    ):
        model, _ = two_halves(material, **values)
        with pytest.raises(ModelError, match=rf"interfaces\[0\].{key} .* cannot be used with .*; leave it out"):
            prepare(model, Options(threads=1))


def test_a_strength_that_the_horizon_cannot_have_is_refused() -> None:
    model, _ = two_halves(COHESIVE, G0=1.0)
    with pytest.raises(ModelError, match=r"interfaces\[0\]: E, G0 and f_t need a horizon below"):
        prepare(model, Options(threads=1))


def test_a_scene_names_what_is_wrong() -> None:
    scene = Scene(box(0, 0, 0.02, 0.02), 1e-3, GLASS)
    with pytest.raises(SceneError, match=r"interface 'weld'\.between\[0\]: no region is called 'lower'"):
        build(scene.interface(("lower", "rest"), G0=1.0, name="weld"))
    with pytest.raises(SceneError, match="interface 'weld'"):
        scene.interface(("lower", "rest"), G0=-1.0, name="weld")
