"""The largest principal stress of a bond, from the stresses of its ends."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.laws.law import INNER


@njit(**INNER)
def principal(law, m, i, j, at):  # type: ignore[no-untyped-def]
    """The largest principal value of the mean of two nodes' stresses, given in m from `at` on."""
    if law.d == 2:
        none = m[i, at] * 0
        s = (m[i, at], m[i, at + 1], m[i, at + 2], m[i, at + 3], none, none)
        t = (m[j, at], m[j, at + 1], m[j, at + 2], m[j, at + 3], none, none)
    else:
        s = (m[i, at], m[i, at + 1], m[i, at + 2], m[i, at + 3], m[i, at + 4], m[i, at + 5])
        t = (m[j, at], m[j, at + 1], m[j, at + 2], m[j, at + 3], m[j, at + 4], m[j, at + 5])
    return largest(law.d, s, t)


@njit(**INNER)
def largest(d, s, t):  # type: ignore[no-untyped-def]
    """The largest principal value of the mean of two stresses, six components each; in the plane, of in-plane ones."""
    xx, yy, zz, xy = (s[0] + t[0]) / 2, (s[1] + t[1]) / 2, (s[2] + t[2]) / 2, (s[3] + t[3]) / 2
    if d == 2:
        return (xx + yy) / 2 + np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    xz, yz = (s[4] + t[4]) / 2, (s[5] + t[5]) / 2
    q = (xx + yy + zz) / 3  # O. K. Smith, Commun. ACM 4 (1961) 168
    a, b, c = xx - q, yy - q, zz - q
    p = np.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if p == 0:
        return q
    half = (a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)) / (2 * p * p * p)
    return q + 2 * p * np.cos(np.arccos(min(1.0, max(-1.0, half))) / 3)
