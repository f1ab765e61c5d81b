"""How functions are compiled that only compiled code calls: once, together with what calls them.

numba optimizes each function with all that it calls, and turns it into machine code, before its caller is compiled,
which does all of that again: a function at depth n is compiled n times. Here the outermost function alone is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from itertools import count
from typing import Any

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.extending import overload

_numbers = count()


def is_none(numba_type: Any) -> bool:
    """Whether None is passed for an argument of this type: what it would ask for is not compiled then."""
    return isinstance(numba_type, types.NoneType)


class _Nowhere:
    """Where machine code of parts lies."""

    def set_env(self, name: str, environment: Any) -> None:
        """Tell machine code where its Python objects are: it has none."""


class _Part(JITCodeLibrary):
    """Code of a function that is linked into its callers, and never called by itself."""

    codegen = _Nowhere()

    def _optimize_final_module(self) -> None:
        """Leave that to the callers."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """The address in machine code: there is none."""
        self._ensure_finalized()
        return 0


class _PartCompiler(Compiler):
    """numba's compiler, for a function whose machine code is that of its callers."""

    def __init__(self, typing_context: Any, target: Any, library: Any, *others: Any) -> None:
        super().__init__(typing_context, target, library or _Part(target.codegen(), f"part {next(_numbers)}"), *others)
        self.state.library.enable_object_caching()


# Leaving out what Python would call a function by saves a quarter of the compile. Nor does it make arrays: counting
# references to those it is given took a tenth of a step
INNER: dict[str, Any] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "_nrt": False,
    "pipeline_class": _PartCompiler,
}


def overloaded(jit_options: dict[str, Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """What decorates a function of the types of its arguments that returns what compiled code calls in its place."""

    def decorate(choose: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(choose)
        def of_values(*_: Any) -> Any:
            raise NotImplementedError(f"{choose.__name__} is compiled for types of its arguments")

        overload(of_values, jit_options=jit_options)(choose)
        return of_values

    return decorate
