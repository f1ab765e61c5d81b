"""Solutions with old factors: what they leave, when they take too long, and what they depend on."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from pdsolve.rest.equilibrium import SingularTangentError
from pdsolve.rest.factors import CHANGED, Factors, FreeComponents


def chain(softening: float, springs: int, all_by: float = 0.0, count: int = 401) -> csr_array:
    """A chain of springs, some in its middle softer by random shares, up to this one."""
    each = np.full(count, 1.0 - all_by)
    middle = slice(count // 2 - springs // 2, count // 2 + (springs + 1) // 2)
    each[middle] -= softening * np.random.default_rng(2).random(springs)
    return diags_array([-each[1:-1], each[:-1] + each[1:], -each[1:-1]], offsets=[-1, 0, 1]).tocsr()


def factors_of(matrix: csr_array, symmetric: bool = True) -> Factors:
    return Factors(matrix, FreeComponents(np.ones((matrix.shape[0], 1), dtype=bool)), symmetric)


LEFT = 1e-3
RIGHT = np.column_stack([np.sin(np.arange(400.0)), np.ones(400)])


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize(("softening", "all_by"), [(0.9, 0.0), (3.0, 0.0), (0.9, 1e-4)])
def test_old_factors_solve_for_softer_springs(softening: float, all_by: float, symmetric: bool) -> None:
    """The true residuals of two right sides count, of softer chains and of indefinite ones."""
    factors = factors_of(chain(0.0, 0), symmetric)
    assert factors.solve(chain(softening / 2, 10), RIGHT, LEFT) is not None
    softer = chain(softening, 20, all_by)
    solution = factors.solve(softer, RIGHT, LEFT)
    assert solution is not None
    left = np.linalg.norm(RIGHT - softer @ solution, axis=0) / np.linalg.norm(RIGHT, axis=0)
    assert left.max() <= LEFT
    if all_by == 0:
        assert left.max() < 1e-9


def test_a_guess_is_refined() -> None:
    """The first right side has its solution already, which no step makes worse."""
    factors, softer = factors_of(chain(0.0, 0)), chain(0.9, 20)
    exact = np.linalg.solve(softer.toarray(), RIGHT)
    solution = factors.solve(softer, RIGHT, 1e-7, np.column_stack([exact[:, 0], 0 * exact[:, 1]]))
    assert solution == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("softening", [0.3, 1.2])
def test_too_many_changes_are_left_to_new_factors(softening: float) -> None:
    count = CHANGED + 10
    factors = factors_of(chain(0.0, 0, count=count))
    softer = chain(softening, count, count=count)
    assert factors.solve(softer, np.ones((count - 1, 1)), LEFT) is None
    assert not factors.keep_components(factors.changed_components(softer))


def test_solutions_do_not_depend_on_what_was_solved_before() -> None:
    """After the same components are kept, to the bit: a run that is resumed has solved for nothing else."""
    softer = chain(0.9, 20)
    fresh, used = factors_of(chain(0.0, 0)), factors_of(chain(0.0, 0))
    used.solve(chain(0.9, 60), RIGHT, LEFT)
    used.solve(chain(0.5, 4), RIGHT, LEFT)
    for factors in (fresh, used):
        assert factors.keep_components(factors.changed_components(softer))
    one, other = fresh.solve(softer, RIGHT, LEFT), used.solve(softer, RIGHT, LEFT)
    assert one is not None
    assert np.array_equal(one, other)


def test_right_sides_of_changed_components_take_no_factors() -> None:
    """A right side at the softer springs alone is solved by their columns, as exactly as by factors."""
    factors, softer = factors_of(chain(0.0, 0)), chain(0.9, 20)
    assert factors.solve(softer, RIGHT, LEFT) is not None
    factors._inverse = None
    right = np.zeros((400, 1))
    right[200] = 1.0
    assert factors.solve_approximately(right) == pytest.approx(np.linalg.solve(softer.toarray(), right), rel=1e-9)


def test_parts_of_matrices_of_a_pattern_share_one() -> None:
    softer, rows = chain(0.9, 20), np.arange(3, 399, 2)
    other = csr_array((2 * softer.data, softer.indices, softer.indptr), softer.shape)
    free = FreeComponents(np.isin(np.arange(400), rows).reshape(200, 2))
    first, second = free.part_of(softer), free.part_of(other)
    assert np.array_equal(first.toarray(), softer.toarray()[np.ix_(rows, rows)])
    assert np.array_equal(second.toarray(), 2 * first.toarray())
    assert np.shares_memory(first.indices, second.indices)
    assert np.array_equal(free.part_of(chain(0.0, 0)).toarray(), chain(0.0, 0).toarray()[np.ix_(rows, rows)])


def test_singular_tangents_are_refused() -> None:
    """As of a chain whose ends are free."""
    matrix = diags_array([-np.ones(3), np.array([1.0, 2.0, 2.0, 1.0]), -np.ones(3)], offsets=[-1, 0, 1]).tocsr()
    with pytest.raises(SingularTangentError):
        factors_of(matrix)
