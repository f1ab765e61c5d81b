"""Checks of a model before it is solved, and of a run's energy at its end.

Impossible is a ModelError, doubtful a ModelWarning; each says where, what was found and what was expected.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model import unused_settings
from pdmesh.model.amounts import MUCH, damping_warning
from pdmesh.model.cohesive_softening import COARSE, characteristic_length, largest_horizon
from pdmesh.model.contradictions import Case
from pdmesh.model.document import Displacement, InitialVelocity, Timed
from pdmesh.model.lattice_calibration import along_axes, lattice_ratios
from pdmesh.model.neighbours import ROUND_OFF, Neighbours, row_chunks, tree_of
from pdmesh.model.node_grid import Grid
from pdmesh.model.output_fields import usual
from pdmesh.model.possible import impossible
from pdmesh.model.rigid_bodies import components_set
from pdmesh.model.selection import components, data_too_short
from pdmesh.model.suggestions import called
from pdmesh.model.triangulated_surface import distances
from pdsolve.bonds.interfaces import Interfaces, cut_of_springs
from pdsolve.laws import law_named, material_checks, micropolar
from pdsolve.model import Model, ModelError, ModelNote, ModelWarning
from pdsolve.operators.protocol import Operator
from pdsolve.options import Options
from pdsolve.state import State

POINT = 2  # nodes of a support that is a point
CONVEX = 1e-3  # of the area: what chords of curves may lack
USUAL_RATIO = 3.0  # of horizon to spacing
SAME = 1e-6  # spacings: nodes this near are at one place but for round-off
CLOSE = 0.1  # spacings: nodes this near make the stable step tiny
JUMP = 2.5  # spacing of a node over that of the nearest: more than the 2 that zones are graded by
AT_ONCE = 2**18  # nodes of which it is seen together whether a crack goes through them
ON = 1e-6  # spacings: a crack this near a node passes through it
AROUND_ONE = 1.5  # spacings: nearly every node has another this near
MADE = 0.05  # of the energy put in
TAKEN = 0.8  # of the energy of bonds that break
SEEN = 1e-3  # of the energy put in: less says nothing of bonds
LOST = 0.1  # of the energy put in: a symmetric operator that loses more is not being integrated


class Nearest(NamedTuple):
    """The nearest other node of each node (n,)."""

    row: NDArray[np.int64]
    distance: NDArray[np.float64]  # m; infinite where there is no other


def nearest(model: Model) -> Nearest:
    """The nearest other node of each node, and its distance, m."""
    position, delta = model.grid.position, model.grid.delta
    nearest_nodes = Nearest(np.zeros(len(position), dtype=np.int64), np.full(len(position), np.inf))
    around = Neighbours(position, delta, AROUND_ONE * delta)
    for rows in row_chunks(len(position)):
        pairs = around.pairs(rows)
        order = np.lexsort((pairs.length, pairs.source))
        row, at = np.unique(pairs.source[order], return_index=True)
        nearest_nodes.row[row], nearest_nodes.distance[row] = pairs.target[order[at]], pairs.length[order[at]]
    lonely = np.flatnonzero(np.isinf(nearest_nodes.distance))
    if len(lonely) and len(position) > 1:
        distance, near = tree_of(position).query(position[lonely], 2)
        nearest_nodes.row[lonely], nearest_nodes.distance[lonely] = near[:, 1], distance[:, 1]
    return nearest_nodes


def refuse_combinations(model: Model, options: Options) -> None:
    """Raise ModelError for features of a model and of its run that exclude each other."""
    ranks = options.team is not None
    case = Case(model.settings, model.grid.dimension, options.mode, options.precision, ranks, options.kernel)
    case = case._replace(fields=model.grid.field_quantities)
    for wrong in impossible(case):
        raise ModelError(f"{model.name}: {wrong}")


def refuse_numbers(model: Model, partial_cells: bool) -> None:
    """Raise ModelError for a model of an unknown law or without stiffness.

    `partial_cells` tells whether the family extends half a spacing beyond the horizon.
    """
    _refuse_cohesive_fields(model)
    _refuse_cohesive_interfaces(model)
    for number, material in enumerate(model.materials):
        place = model.place_of(number)
        law_named(material, place)
        ratio = model.settings.horizon.ratio
        if material.law == "cohesive" and (widest := _widest(model, number)) >= largest_horizon(material, ratio):
            raise ModelError(
                f"{place}.f_t gives l_ch = E G0 / f_t^2 = {characteristic_length(material):.4g} m with a horizon of"
                f" {widest:g} m; use a horizon below {largest_horizon(material, ratio):.4g} m: bonds hold more than"
                " G0 when they begin to soften"
            )
        if not lattice_ratios(ratio, material.micromodulus, material.plane, partial_cells).c11 > ROUND_OFF:
            raise ModelError(
                f"{model.name}: $.horizon.ratio is {ratio:g}, where bonds of a {material.micromodulus} micromodulus"
                " have no stiffness; use more than 1 (3 is usual)"
            )


def _refuse_cohesive_fields(model: Model) -> None:
    """Raise ModelError for a node whose own constants give bonds that hold more than G0 when they begin to soften."""
    every = np.arange(len(model.grid))
    for places, material in model.materials_at(every) if model.grid.fields else ():
        if material.law == "cohesive":
            rows, ratio = every[places], model.settings.horizon.ratio
            room = largest_horizon(material, ratio) - model.horizons[rows]
            if room.min() <= 0:
                worst = int(rows[room.argmin()])
                raise ModelError(
                    f"{model.name}: $.fields: E, G0 and f_t of {named(model, worst)} need a horizon"
                    f" {-room.min():.4g} m less than {model.horizons[worst]:g} m; use a finer spacing, or a smaller f_t"
                )


def _refuse_cohesive_interfaces(model: Model) -> None:
    """Raise ModelError for an interface whose bonds hold more than its G0 when they begin to soften."""
    if not model.settings.interfaces:
        return
    ratio, interfaces = model.settings.horizon.ratio, Interfaces(model)
    for number, interface in enumerate(model.settings.interfaces):
        for at in np.flatnonzero(interfaces.materials(number)):
            material, widest = model.materials[at], _widest(model, int(at))
            if material.law != "cohesive":
                continue
            own = {"G0": interface.G0 or material.G0, "f_t": interface.f_t or material.f_t}
            one = msgspec.structs.replace(material, E=material.E * interface.stiffness, **own)
            cost = cut_of_springs(material, ratio).largest_cost()  # a bond has its G0 over this or less
            if (most := largest_horizon(one, ratio) / cost) <= widest:
                raise ModelError(
                    f"{model.name}: $.interfaces[{number}]: E, G0 and f_t need a horizon below {most:.4g} m, not"
                    f" {widest:g} m; use a finer spacing, or a smaller f_t"
                )


def refuse_fields(model: Model, operator: Operator, state: State) -> None:
    """Raise ModelError for a requested field that the model does not have."""
    usual_fields = usual(model.grid.dimension)
    extra_fields = [name for name in model.settings.run.fields if name not in usual_fields]
    operator_fields = operator.fields(state) if extra_fields else {}
    for name in extra_fields:
        if name not in operator_fields:
            expected = ", ".join((*usual_fields, *operator_fields))
            raise ModelError(f"{model.name}: $.run.fields has '{name}'; use one of {expected}")


def warn_of_model(model: Model, unbonded: NDArray[np.int64], partial_cells: bool, symmetric: bool) -> None:
    """Warn of models that can be solved but are probably not intended.

    `unbonded` (k,) are the rows of nodes without bonds, `partial_cells` is as in `refuse_numbers`, `symmetric` as in
    `closing`. Raises ModelError for coincident nodes.
    """
    every_E = model.node_values("E")
    stiffest, softest = every_E.max(), every_E.min()
    if stiffest > softest and not symmetric:
        warn(
            model,
            f"$.regions: E goes from {softest:g} to {stiffest:g} Pa, and the thesis mode needs one E: a bond has"
            " the constants of its own node there, and carries no stress from one material to the other",
        )
    farthest, least = float(np.abs(_ends(model.grid)).max()), float(model.horizons.min())
    precision = float(np.spacing(farthest))
    needed = ROUND_OFF * least / 4  # both ends of a bond, up and down
    if precision > needed:
        warn(
            model,
            f"$.nodes: coordinates up to {farthest:.3g} m are known to {precision:.2g} m, and horizons of {least:.3g} m"
            f" need {needed:.2g} m: round-off decides who sees whom; move the plate to the origin",
        )
    if model.grid.lattice is None:
        _places(model, nearest(model))
    for number in Interfaces(model).uncrossed(partial_cells) if model.settings.interfaces else ():
        name = model.settings.interfaces[number].name or f"{number + 1}"
        warn(
            model,
            f"$.interfaces[{number}]: interface '{name}' crosses no bond; name regions that touch, or"
            " draw it inside the model, in m",
        )
    lonely = np.setdiff1d(unbonded, _cracks(model))
    lonely = lonely[~model.grid.rigid[lonely]] if model.grid.bodies is not None else lonely
    if len(lonely):
        warn(
            model,
            f"$.nodes: {len(lonely)} have no bond, the first {named(model, int(lonely[0]))}; nothing holds such a"
            " node back: give it neighbours within the horizon, inside the plate",
        )
    _shapes(model)
    _probes(model)
    for number, material in enumerate(model.materials):
        if material.law == "cohesive":
            widest, most = _widest(model, number), COARSE * characteristic_length(material)
            if widest > most:
                warn(
                    model,
                    f"$.horizon is {widest:g} m, more than {most:.4g} m, {COARSE:.2g} of l_ch = E G0 / f_t^2:"
                    " strengths of coarser lattices are not known; use a finer spacing",
                )
    for remark_on_material in material_checks.remarks(model):
        warn(model, remark_on_material)
    _smooth_edges(model)
    _few_neighbours(model, partial_cells, symmetric)


def _few_neighbours(model: Model, partial_cells: bool, symmetric: bool) -> None:
    """Warn once of horizons so short that the lattice has not the stiffness of its material."""
    ratio, number = model.settings.horizon.ratio, {2: "four", 3: "six"}[model.grid.dimension]
    for material in model.materials:
        springs = material.model == "bond"
        if not lattice_ratios(ratio, material.micromodulus, material.plane, partial_cells).c66 > ROUND_OFF:
            young = f": E along the axes is {along_axes(material, ratio).young:.3g} times that given" if springs else ""
            warn(
                model,
                f"$.horizon.ratio is {ratio:g}, where only the {number} nearest nodes pull and nothing resists"
                f" shear{young}; use 1.5 or more (3 is usual)",
            )
            return
        beams = material.model == "micropolar" and material.law != "cohesive" and material.influence is None
        if ratio < USUAL_RATIO and (beams or (springs and not symmetric)):
            bar = micropolar.along_axes(material, ratio) if beams else along_axes(material, ratio, one_sided=True)
            where = ("with micropolar beams", "") if beams else ("in the thesis mode", ", or the conservative mode")
            warn(
                model,
                f"$.horizon.ratio is {ratio:g} {where[0]}, whose lattice is not calibrated: E along the axes is"
                f" {bar.young:.3g} times that given and Poisson's ratio {bar.poisson:.3g}; use {USUAL_RATIO:g} or"
                f" more{where[1]}",
            )
            return


def _widest(model: Model, number: int) -> float:
    """The largest horizon of the nodes of a material, m."""
    return float(np.max(model.horizons[model.material_of == number], initial=0.0))


def _smooth_edges(model: Model) -> None:
    """Warn of cohesive plates that bend on point supports, and whose cracks can only start at a smooth edge."""
    grid, conditions = model.grid, model.settings.conditions
    if all(material.law != "cohesive" for material in model.materials) or grid.dimension == 3:
        return
    on_points = any(
        0 < len(model.selected(condition)) <= POINT for condition in conditions if isinstance(condition, Displacement)
    )
    if not grid.outline or grid.holes or len(grid.cracks) or not (on_points or model.settings.contact is not None):
        return
    import shapely  # here, as few plates are asked for their hull

    plates = [shapely.Polygon(ring) for ring in grid.outline]
    if all(plate.area > (1 - CONVEX) * plate.convex_hull.area for plate in plates):
        warn(
            model,
            "a plate of cohesive bonds on point supports has no notch, hole or pre-crack; add one if it bends: a"
            " beam that cracks from its smooth edge carries 16 to 24 % more than f_t and G0 give, the more the"
            " finer",
        )


def warn_of_unused(model: Model) -> None:
    """Warns of settings that the run does not use."""
    for said in unused_settings.remarks(model.settings):
        warn(model, said)


def warn(model: Model, message: str) -> None:
    """Issue a ModelWarning about this model, in one line."""
    warnings.warn(f"{model.name}: {message}", ModelWarning, stacklevel=2)


def named(model: Model, row: int) -> str:
    """A node in words."""
    node = model.grid.part(np.array([row]))
    place = ", ".join(f"{value:.6g}" for value in node.position[0])
    return f"node {node.ids[0]} at ({place}) m"


def _places(model: Model, nearest: Nearest) -> None:
    """Check for nodes too close to each other, and for jumps in spacing."""
    grid = model.grid
    near = nearest.distance / np.minimum(grid.delta, grid.delta[nearest.row])
    row = int(near.argmin())
    pair = f"{named(model, row)} and {named(model, int(nearest.row[row]))}"
    if near[row] < SAME:
        raise ModelError(
            f"{model.name}: $.nodes: {pair} are {nearest.distance[row]:.3g} m apart, which is the same place but for"
            " round-off; move them apart"
        )
    if near[row] < CLOSE:
        warn(
            model,
            f"$.nodes: {pair} are {near[row]:.2g} spacings apart, and about one is usual; so stiff a bond makes the"
            " stable time step small",
        )
    jump = np.where(np.isfinite(nearest.distance), grid.delta / grid.delta[nearest.row], 1.0)
    jump = np.maximum(jump, 1 / jump)
    row = int(jump.argmax())
    if jump[row] > JUMP:
        warn(
            model,
            f"$.nodes: spacings of {grid.delta[row]:g} and {grid.delta[nearest.row[row]]:g} m are next to each other,"
            f" {named(model, row)}; use steps of at most 2 (pdmesh grades zones so): the jump reflects waves",
        )


def _ends(grid: Grid) -> NDArray[np.float64]:
    """The low and the high corner (2, d) of all nodes, m."""
    if grid.lattice is not None:
        return grid.part(np.array([0, len(grid) - 1])).position
    return np.array([grid.position.min(axis=0), grid.position.max(axis=0)])


def _cracks(model: Model) -> NDArray[np.int64]:
    """Rows (k,) of nodes on a pre-crack."""
    grid = model.grid
    corners = grid.cracks.reshape(-1, grid.dimension)
    if not len(corners):
        return np.zeros(0, dtype=np.int64)
    reach = float(grid.delta.max())
    near = grid.chosen(None, [*(corners.min(axis=0) - reach), *(corners.max(axis=0) + reach)])
    chunks = np.split(near, range(AT_ONCE, len(near), AT_ONCE))
    if grid.dimension == 3:
        triangles, hits = grid.cracks.reshape(-1, 3, 3), []
        for rows in chunks:
            part = grid.part(rows)
            away = distances(part.position, triangles, ON * float(grid.delta.max()))
            hits.append(rows[away < ON * part.delta])
        on_faces = np.concatenate(hits)
        if len(on_faces):
            warn(
                model,
                f"$.notch runs through {len(on_faces)} nodes, the first {named(model, int(on_faces[0]))}; put it"
                " between nodes: all bonds of such a node are cut",
            )
        return on_faces
    import shapely  # here, as a plate without cracks needs none

    segments = grid.cracks.reshape(-1, 2, 2)
    cracks = shapely.multilinestrings(segments)
    shapely.prepare(cracks)
    rows_near_cracks = (
        rows[shapely.dwithin(cracks, shapely.points(grid.part(rows).position), ON * reach)] for rows in chunks
    )
    rows = np.concatenate(list(rows_near_cracks))
    part, hit = grid.part(rows), np.zeros(len(rows), dtype=bool)
    points = shapely.points(part.position)
    for number, segment in enumerate(segments):
        on = shapely.distance(points, shapely.linestrings(segment)) < ON * part.delta
        if on.any():
            warn(
                model,
                f"$.notch[{number}] runs through {on.sum()} nodes, the first"
                f" {named(model, int(rows[on.argmax()]))}; put it between nodes (pdmesh shifts its lattice): all"
                " bonds of such a node are cut, or those to one side by round-off",
            )
        hit |= on
    return np.asarray(rows[hit])


def _probes(model: Model) -> None:
    """Raise ModelError for a probe outside the plate or the body."""
    grid = model.grid
    places = np.reshape(model.settings.run.probes, (-1, grid.dimension))
    if not len(places):
        return
    away, row = grid.nearest(places)
    for number in np.flatnonzero(away > grid.delta[row]).tolist():
        place = ", ".join(f"{value:g}" for value in places[number])
        whole = "plate" if grid.dimension == 2 else "body"
        raise ModelError(
            f"{model.name}: $.run.probes[{number}]: ({place}) m is outside of the {whole}; use a place in it, such as"
            f" that of the nearest node, {named(model, int(row[number]))}"
        )


def _shapes(model: Model) -> None:
    """Warn of plates that are only a few nodes wide."""
    grid, widest = model.grid, float(model.horizons.max())
    extent = float(np.ptp(_ends(grid), axis=0).max() + grid.delta.max())
    if len(grid) < 3:
        return
    if widest > extent / 2 * (1 + ROUND_OFF):
        warn(
            model,
            f"$.horizon is {widest:g} m in a plate of {extent:g} m; use less than half of it: every node is a"
            " surface node, and the plate too stiff",
        )
    if grid.lattice is not None:
        is_flat = min(grid.lattice.counts) == 1
    else:
        middle = grid.position - grid.position.mean(axis=0)
        is_flat = bool(np.sqrt(np.linalg.eigvalsh(middle.T @ middle)[0].clip(min=0)) < ON * extent)
    if is_flat:
        noun, plural = ("row", "rows") if model.grid.dimension == 2 else ("layer", "layers")
        warn(
            model,
            f"$.nodes: all {len(grid)} are in one {noun}; use several {plural}: bonds along a {noun} do not resist"
            " motion across it",
        )


def warn_of_damping(model: Model, damped: float, put_in: float) -> None:
    """Warn, at the end of a run in time, if damping took much of the supplied energy `put_in`, J/m."""
    said = damping_warning(model.settings.run, model.settings.conditions, model.settings.contact, damped, put_in)
    if said is not None and model.settings.run.solver != "static":  # at rest every crack gives some up
        warn(model, said)


def warn_of_created_energy(model: Model, gain: float, put_in: float) -> None:
    """Warn, at the end of a run with a moving fine zone, if changes of cells gained or lost much energy (`gain`, J/m),
    compared with the supplied energy `put_in`."""
    if model.settings.run.adapt != "hybrid" or put_in <= 0 or abs(gain) <= MADE * put_in:
        return
    warn(
        model,
        f"changes of cells made {100 * gain / put_in:+.2g} % of the energy put in, more than {100 * MADE:g} %; a"
        " smaller run.hybrid.kappa helps",
    )


def warn_of_missing_dissipation(model: Model, created: float, put_in: float, spent: float) -> None:
    """Warn, at the end of a run on nodes that do not change, if its bonds took less than they have booked as `spent`.

    `created`, J/m, is the error of the balance, `put_in` the energy that was supplied.
    """
    if model.settings.run.adapt != "none" or model.settings.contact is not None or created <= SEEN * put_in:
        return
    if created > (1 - TAKEN) * spent > 0:
        warn(
            model,
            f"bonds that broke took {1 - created / spent:.2f} of their energy from the motion, and {TAKEN:g} is the"
            " least: they break within a step or two; use a smaller run.time_step",
        )


def closing(model: Model, balance: float, spent: float, symmetric: bool) -> None:
    """Warn, at the end of a run, if energy does not balance although the operator is `symmetric`, or coupled.

    `balance` is that of the last ledger entry; `spent`, J/m, was dissipated by softening and breaking bonds.
    """
    if spent < 0:
        warn(
            model,
            f"breaking bonds dissipated {spent:.3g} J/m, which is below 0: compressed bonds broke within one step,"
            " as in a plate that is crushed; use a smaller time step",
        )
    coupled = model.settings.run.adapt == "collocation"
    if coupled and abs(balance) > MUCH:
        warn(
            model,
            f"the energy balance error is {balance:+.2g} of the energy put in, more than {MUCH:g}: stencils beside"
            " bonds make or lose it; use a larger run.collocation.margin or horizon",
        )
    if symmetric and not coupled and abs(balance) > LOST:
        advice = (
            "bodies that are crushed into single nodes gain energy in contact; try half of this time step"
            if model.settings.contact is not None
            else "check the time step, and loads or prescribed motion that begin suddenly"
        )
        warn(model, f"the energy balance error is {balance:+.2g} of the energy put in, more than {LOST:g}; {advice}")


LITTLE = 0.1  # of the peak of a profile: a run in which less acts may be one of other units


def warn_of_doubtful_conditions(model: Model, time_step: float) -> None:
    """Warn of conditions that hardly act in a run in steps of `time_step`, s, of zeros that set nothing, and of a
    restitution that bodies do not show. Raises ModelError for data that end before the run."""
    wrong = data_too_short(model.settings.conditions, (model.settings.run.steps - 1) * time_step)
    if wrong is not None:
        raise ModelError(f"{model.name}: {wrong}")
    _warn_of_profiles_far_below_peak(model, time_step)
    _warn_of_ignored_zero_velocities(model)
    contact, bodies = model.settings.contact, model.grid.bodies
    if contact is None or contact.restitution == 1 or bodies is None or len(bodies.rigid) == len(bodies.names):
        return
    warnings.warn(
        f"{model.name}: $.contact.restitution is {contact.restitution:g} with bodies that deform, which usually"
        " rebound with more: it holds for pairs of nodes in contact, and the elastic energy inside the bodies returns"
        " in full; rigid bodies rebound with it",
        ModelNote,
        stacklevel=2,
    )


def _warn_of_profiles_far_below_peak(model: Model, time_step: float) -> None:
    """Warn of conditions whose profile stays far below its peak in a run in steps of `time_step`, s."""
    run = model.settings.run
    if run.solver == "static" and model.settings.physics == "mechanics":
        return  # whose load steps go to the end of the profiles
    end = run.steps * time_step
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, Timed) or len(condition.profile) < 2:
            continue
        time, factor = np.array(condition.profile, dtype=float).T
        acts = np.abs([*factor[time <= end], np.interp(end, time, factor)]).max()
        peak, at = float(np.abs(factor).max()), float(time[np.abs(factor).argmax()])
        if acts < LITTLE * peak:
            named = f"{condition.__struct_config__.tag} '{called(condition.name, number)}'"
            warn(
                model,
                f"$.conditions[{number}].profile: {acts / peak:.2g} of the peak of {named} acts within the run's"
                f" {end:.3g} s: the peak comes at {at:.3g} s; use a longer run.duration or a shorter profile"
                " (quasi-static: run.solver static)",
            )


def _warn_of_ignored_zero_velocities(model: Model) -> None:
    """Warn of a component of an initial velocity that is 0 where an earlier one is not, as it leaves that."""
    earlier: list[tuple[int, InitialVelocity]] = []
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, InitialVelocity):
            continue
        for axis, value, sets in zip("xyz", components(condition), components_set(condition), strict=True):
            for earlier_number, before in earlier if value == 0.0 and not sets else ():
                common = np.intersect1d(model.selected(condition), model.selected(before))
                if getattr(before, axis) not in (None, 0.0) and len(common):
                    warn(
                        model,
                        f"$.conditions[{number}].{axis} is 0 beside another component, which leaves what"
                        f" $.conditions[{earlier_number}] gives {len(common)} of its nodes; one condition with all"
                        " components sets a node's velocity to 0 along an axis",
                    )
        earlier.append((number, condition))
