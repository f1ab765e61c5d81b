"""Stress response and history of a node, for any of the materials.

Deformations are displacement gradients in space; in the plane, the rows and columns of z are 0 except for the
material's zz. The response is from the start (total), or incremental (rate, T. J. R. Hughes, J. Winget, Int. J. Numer.
Methods Eng. 15 (1980) 1862-1867): with F in the middle of a step, L = dF F^-1, D and W its parts,

    sigma' = Q (Q sigma Q^T + lambda tr D I + 2 mu D) Q^T        Q Q = (I - W / 2)^-1 (I + W / 2)

so that a turn is exact, and steps of stretch and turn together are of second order.

The history of a node is: for j2, total: plastic strain (6), alpha; for rates: F (9), sigma (6), alpha.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll, njit
from numpy.typing import NDArray

from pdmesh.model.material_constants import lame
from pdsolve.laws.law import INLINE, INNER
from pdsolve.laws.materials import j2, linear, neo_hooke, orthotropic, svk
from pdsolve.laws.materials.tensors import (
    added,
    compliant,
    contracted,
    det,
    difference,
    full,
    grown,
    hooke,
    inverse,
    mean,
    symmetric,
    transposed,
    with_zz,
)
from pdsolve.laws.small_tensors import product
from pdsolve.model import Model

LINEAR, SVK, NEO_HOOKE, J2, ORTHOTROPIC = range(5)
KINDS = {"linear": LINEAR, "svk": SVK, "neo hooke": NEO_HOOKE, "j2": J2, "orthotropic": ORTHOTROPIC}
FLOWING = 1 / 8  # factor of silling's control, over the secant stiffness, that is enough where nodes flow
WAN = 1.5  # factor of silling's control that is about as strong as wan's
ALPHA_TOTAL, ALPHA_RATE = 6, 15  # where alpha is in what is remembered


class SolidColumns(NamedTuple):
    """Columns of n nodes."""

    kind: NDArray[np.int8]  # (n,) as above
    first: NDArray[np.floating]  # (n,) lambda, Pa; of orthotropic nodes 0
    shear: NDArray[np.floating]  # (n,) mu, Pa; of orthotropic nodes half the largest stress over strain
    yields: NDArray[np.floating]  # (n,) sigma_y, Pa
    hardening: NDArray[np.floating]  # (n,) H, Pa
    history: NDArray[np.floating]  # (n, 0, 7 or 16)
    plane_stress: bool
    rate: bool
    ease: float = 1.0  # of the control of deviations to flow, that of the stress being 1; see `j2`
    ply: NDArray[np.floating] = orthotropic.NO_PLIES  # (n or 0, 17) of orthotropic nodes; see `orthotropic.columns`


class Response(NamedTuple):
    """The response of a solid to a deformation: stresses, deformation gradient, plastic strain."""

    P: Any  # first Piola-Kirchhoff stress, Pa, nine
    sigma: Any  # Cauchy's, six
    F: Any  # with zz, nine
    more: Any  # alpha since what is remembered, over sqrt(2/3)
    flow: Any  # x of `j2.returned`, 0 where nothing flows


def solid_of(model: Model, kind: Any, dimension: int) -> SolidColumns:
    """Columns of a model's nodes, in this precision."""
    of, first = model.material_of, model.materials[0]
    rate, plastic = first.form == "rate", any(material.solid == "j2" for material in model.materials)
    yields = model.node_values("yield_stress", np.inf), model.node_values("hardening")
    history = np.zeros((len(of), 16 if rate else 7 if plastic else 0))
    if rate:
        history[:, [0, 4, 8]] = 1
    kinds = np.array([KINDS[material.solid] for material in model.materials], dtype=np.int8)[of]
    plies = kinds == ORTHOTROPIC  # whose nu12 may be 0.5 and more
    moduli = lame(model.node_values("E"), np.where(plies, 0.0, model.node_values("nu")))
    ply, stiffest = orthotropic.columns(model, np.flatnonzero(plies))
    if len(ply):  # of no lambda, so that lambda + 2 mu is the stiffness in plane stress, too
        moduli = np.where(stiffest > 0, 0.0, moduli[0]), np.where(stiffest > 0, stiffest / 2, moduli[1])
    numbers = (np.asarray(c, dtype=kind) for c in (*moduli, *yields, history, ply))
    first_, shear, flow, hardening, past, ply = numbers
    flat = dimension == 2 and first.plane == "stress"
    factor = WAN if first.control == "wan" else first.control_factor
    return SolidColumns(kinds, first_, shear, flow, hardening, past, flat, rate, max(1.0, factor / FLOWING), ply)


@njit(**INLINE)
def respond(solid, dt, i, h, deviation_square):  # type: ignore[no-untyped-def]
    """Response of node i to the gradient h, nine components, `dt` s after its history; 0 as in `pdsolve.laws.law`.

    `deviation_square`, Pa^2, is b of `j2`.
    """
    first, shear, kind = solid.first[i], solid.shear[i], solid.kind[i]
    if solid.rate:
        return _rated(solid, dt, i, grown(h), deviation_square)
    if kind == NEO_HOOKE:
        E = neo_hooke.strain(h, first, shear, solid.plane_stress)
        return _finite(neo_hooke.stress(h, E, first, shear), h, E, solid.plane_stress)
    if kind == J2:
        s, p = symmetric(h), solid.history[i]
        e = (s[0] - p[0], s[1] - p[1], s[2] - p[2], s[3] - p[3], s[4] - p[4], s[5] - p[5])  # the elastic strain
        trial, alpha = hooke(first, shear, e), solid.history[i, ALPHA_TOTAL]
        zz = h[0] * 0
        if solid.plane_stress:
            zz = j2.thinned(
                trial, alpha, first, shear, solid.yields[i], solid.hardening[i], deviation_square, solid.ease
            )
            trial = hooke(first, shear, with_zz(e, e[2] + zz))
        sigma, more, x = j2.returned(
            trial, alpha, shear, solid.yields[i], solid.hardening[i], deviation_square, solid.ease
        )
        return Response(full(sigma), sigma, _with_zz(grown(h), zz), more, x)
    if kind == ORTHOTROPIC:
        E = orthotropic.strain(solid.ply[i], h, solid.plane_stress)
        return _finite(orthotropic.stress(solid.ply[i], h, E), h, E, solid.plane_stress)
    return elastic(kind, h, first, shear, solid.plane_stress)


@njit(**INLINE)
def elastic(kind, h, first, shear, plane_stress):  # type: ignore[no-untyped-def]
    """Response of a solid of the kinds LINEAR and SVK."""
    if kind == SVK:
        P = svk.stress(h, first, shear, plane_stress)
        return _finite(P, h, svk.strain(h, first, shear, plane_stress), plane_stress)
    e = linear.strain(h, first, shear, plane_stress)
    sigma = hooke(first, shear, e)
    return Response(full(sigma), sigma, _with_zz(grown(h), e[2]), h[0] * 0, h[0] * 0)


@njit(**INNER)
def energies(solid, dt, i, h, deviation_square):  # type: ignore[no-untyped-def]
    """Energy densities of node i, J/m^3: stored, and dissipated by plastic flow so far."""
    first, shear, kind = solid.first[i], solid.shear[i], solid.kind[i]
    if solid.rate or kind == J2:
        response = respond(solid, dt, i, h, deviation_square)
        alpha = solid.history[i, ALPHA_RATE if solid.rate else ALPHA_TOTAL] + j2.ROOT * response.more
        spent = h[0] * 0
        if kind == J2:
            spent = alpha * (solid.yields[i] + solid.hardening[i] * alpha / 2)
        strain_energy = contracted(response.sigma, compliant(first, shear, response.sigma)) / 2
        if solid.rate:
            strain_energy *= det(response.F)
        return strain_energy, spent
    if kind == SVK:
        E = svk.strain(h, first, shear, solid.plane_stress)
        return contracted(E, hooke(first, shear, E)) / 2, h[0] * 0
    if kind == NEO_HOOKE:
        return neo_hooke.energy(neo_hooke.strain(h, first, shear, solid.plane_stress), first, shear), h[0] * 0
    if kind == ORTHOTROPIC:
        E = orthotropic.strain(solid.ply[i], h, solid.plane_stress)
        return contracted(E, orthotropic.second_stress(solid.ply[i], E)) / 2, h[0] * 0
    e = linear.strain(h, first, shear, solid.plane_stress)
    return contracted(e, hooke(first, shear, e)) / 2, h[0] * 0


@njit(**INNER)
def dissipated(solid, i):  # type: ignore[no-untyped-def]
    """Energy density that node i has dissipated by plastic flow up to what it remembers, J/m^3."""
    if solid.kind[i] != J2:
        return 0.0
    alpha = solid.history[i, ALPHA_RATE if solid.rate else ALPHA_TOTAL]
    return float(alpha * (solid.yields[i] + solid.hardening[i] * alpha / 2))


@njit(**INNER)
def update_history_of(solid, dt, i, h, deviation_square):  # type: ignore[no-untyped-def]
    """Update the history of node i after the gradient h."""
    response, past = respond(solid, dt, i, h, deviation_square), solid.history[i]
    if solid.rate:
        _put(past, 0, response.F)
        _put(past, 9, response.sigma)
        past[ALPHA_RATE] += j2.ROOT * response.more
    elif solid.kind[i] == J2 and response.more > 0:
        first, shear = solid.first[i], solid.shear[i]
        e, elastic_strain = symmetric(h), compliant(first, shear, response.sigma)
        _put(
            past,
            0,
            (
                e[0] - elastic_strain[0],
                e[1] - elastic_strain[1],
                e[2] - elastic_strain[2],
                e[3] - elastic_strain[3],
                e[4] - elastic_strain[4],
                e[5] - elastic_strain[5],
            ),
        )
        if solid.plane_stress:
            past[2] = -past[0] - past[1]
        past[ALPHA_TOTAL] += j2.ROOT * response.more


@njit(**INNER)
def _half_turn(x, y, z):  # type: ignore[no-untyped-def]
    """Q, nine components, from the components xy, xz, yz of W / 2: the half of a turn by 2 atan of their norm."""
    half = 1 / (1 + np.sqrt(1 + x * x + y * y + z * z))
    x, y, z, unit = half * x, half * y, half * z, x * 0 + 1
    return product(inverse((unit, -x, -y, x, unit, -z, y, z, unit)), (unit, x, y, -x, unit, z, -y, -z, unit))


@njit(**INNER)
def _turned(Q, sigma):  # type: ignore[no-untyped-def]
    """Q sigma Q^T, six components."""
    return symmetric(product(product(Q, full(sigma)), transposed(Q)))


@njit(**INNER)
def _put(row, at, values):  # type: ignore[no-untyped-def]
    for value in literal_unroll(values):  # some of which are of double precision where others are not
        row[at] = value
        at += 1


@njit(**INNER)
def _with_zz(a, zz):  # type: ignore[no-untyped-def]
    """Nine components with zz added to the last."""
    return (a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8] + zz)


@njit(**INNER)
def _finite(P, h, E, plane_stress):  # type: ignore[no-untyped-def]
    """Response with Cauchy's stress P F^T / det F; in plane stress F_zz follows from the strain."""
    F = grown(h)
    if plane_stress:
        F = _with_zz(F, np.sqrt(1 + 2 * E[2]) - 1)
    s, c = symmetric(product(P, transposed(F))), 1 / det(F)
    sigma = (c * s[0], c * s[1], c * s[2], c * s[3], c * s[4], c * s[5])
    return Response(P, sigma, F, h[0] * 0, h[0] * 0)


@njit(**INNER)
def _rated(solid, dt, i, F, deviation_square):  # type: ignore[no-untyped-def]
    """Response incremental from the history."""
    p, first, shear, unit = solid.history[i], solid.first[i], solid.shear[i], F[0] * 0 + 1
    flat = solid.plane_stress
    zz = p[8] * unit if flat else F[8]  # not known yet
    F = (F[0], F[1], F[2], F[3], F[4], F[5], F[6], F[7], zz)
    before = (p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8])
    way, half = difference(F, before), mean(before, F)
    L = product(way, inverse(half))
    D = symmetric(L)
    R = _half_turn((L[1] - L[3]) / 4, (L[2] - L[6]) / 4, (L[5] - L[7]) / 4)
    sigma = (p[9], p[10], p[11], p[12], p[13], p[14])
    trial = _turned(R, added(_turned(R, sigma), hooke(first, shear, D)))
    alpha, plastic, more, x = p[ALPHA_RATE], solid.kind[i] == J2, F[0] * 0, F[0] * 0
    if flat:
        d = -trial[2] / (first + 2 * shear)
        if plastic:
            d = j2.thinned(
                trial, alpha, first, shear, solid.yields[i], solid.hardening[i], deviation_square, solid.ease
            )
        trial = (
            trial[0] + first * d,
            trial[1] + first * d,
            trial[2] + (first + 2 * shear) * d,
            trial[3],
            trial[4],
            trial[5],
        )
        F = _with_zz(F, before[8] * d / (1 - d / 2))
    if plastic:
        trial, more, x = j2.returned(
            trial, alpha, shear, solid.yields[i], solid.hardening[i], deviation_square, solid.ease
        )
    c, s = det(F), trial
    P = product(full((c * s[0], c * s[1], c * s[2], c * s[3], c * s[4], c * s[5])), transposed(inverse(F)))
    return Response(P, trial, F, more, x)
