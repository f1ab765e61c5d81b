"""Numbers with names that compiled code reads and writes in place."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

KINDS = {"int": np.int64, "float": np.float64}
_Base: Any = np.record  # its stubs say that nobody inherits from what it inherits from


class Record(_Base):
    """A struct of numbers, in Python as in compiled code; the annotations of a subclass, int or float, are its fields.

    No field may have the name of an attribute of NumPy's arrays, such as `sum`, which would hide it.
    """

    @classmethod
    def fields(cls) -> np.dtype[Any]:
        """The type of an element of an array of these."""
        kinds = [(name, KINDS[kind]) for name, kind in cls.__annotations__.items()]
        return np.dtype((cls, np.dtype(kinds, align=True)))

    @classmethod
    def of(cls, values: Iterable[float] = ()) -> Self:
        """One of these values, in the order of the fields; the rest is 0."""
        record: Self = np.zeros(1, cls.fields())[0]
        for name, value in zip(cls.__annotations__, values, strict=False):
            record[name] = value
        return record

    def values(self) -> NDArray[Any]:
        """A copy of all numbers, in the order of the fields, which are of one type."""
        return np.array(self.item(), dtype=self.dtype[0])
