"""Pair laws that are curved, one of which softens, which no kernel that is stored knows."""

from __future__ import annotations

import numpy as np

from pdsolve.laws.law import Limits, Pair, Softening
from pdsolve.laws.pair import PairColumns, pair_law


class Curved(PairColumns):
    pass


class Unsoftened(PairColumns):
    pass


def limits(material, bonds):
    return Limits(bonds.critical / np.sqrt(material.kr), bonds.critical * np.sqrt(material.kr))


def secant(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    share = stretch / peak
    return 1 / ((1 + worst / limit) * np.sqrt(1 + share * share))


def bond_strain_energy(law, c, stretch, worst, peak, limit):
    share = stretch / peak
    return 2 * c * stretch * stretch / ((1 + worst / limit) * (np.sqrt(1 + share * share) + 1))


def dissipated_energy(law, c, worst, peak, limit):
    return c * worst * worst


def total_dissipated_energy(law, c, peak, limit):
    return c * limit * limit


def softening_slope(law, worst, peak, limit):
    share = worst / peak
    weak, root = 1 + worst / limit, np.sqrt(1 + share * share)
    return (1 - share * share * worst / limit) / (weak * weak * root * root * root)


SOFTENING = Softening(dissipated_energy, total_dissipated_energy, softening_slope)
FUNCTIONS = {"secant": secant, "bond_strain_energy": bond_strain_energy, "softening": SOFTENING}
LAW = pair_law(Curved, Pair(limits=limits, **FUNCTIONS))
UNSOFTENED = pair_law(Unsoftened, Pair(limits=limits, secant=secant, bond_strain_energy=bond_strain_energy))
OWN = {"curved": LAW, "unsoftened": UNSOFTENED}  # by the names that tests give them
