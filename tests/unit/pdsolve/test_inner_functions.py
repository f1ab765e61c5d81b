"""Functions that only compiled code calls are compiled with their callers, not by themselves."""

from __future__ import annotations

import numba

from pdsolve.codegen.inner_functions import INNER


@numba.njit(**INNER)
def _doubled(x):  # type: ignore[no-untyped-def]
    return 2 * x


@numba.njit(**INNER)
def _larger(x):  # type: ignore[no-untyped-def]
    return _doubled(x) + 1


@numba.njit
def _outer(x):  # type: ignore[no-untyped-def]
    return _larger(x) * _doubled(x)


def test_parts_are_linked_and_only_their_caller_has_machine_code() -> None:
    assert _outer(3.0) == 42.0
    assert _outer(3) == 42
    addresses = [
        one.library.get_pointer_to_function(one.fndesc.llvm_func_name)
        for function in (_doubled, _larger)
        for one in function.overloads.values()
    ]
    assert addresses == [0, 0, 0, 0]
    (whole, _) = _outer.overloads.values()
    assert whole.library.get_pointer_to_function(whole.fndesc.llvm_func_name) > 0
