"""Models within results that are not what they may be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest
from messages import naming

from pdsolve.measures.embedded_model import _check, _Model, whole
from pdsolve.results import Results, ResultsError


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"outline": (((0.0, 0.0), (1.0, 0.0), (1.0, 1.0, 0.0)),)}, naming("$.outline[0]")),
        ({"holes": (((0.0, 0.0, 0.0), (1.0, 0.0)),)}, naming("$.holes[0]")),
    ],
)
def test_rings_in_two_dimensions_at_once_are_refused(keys: dict[str, Any], said: str) -> None:
    model = _Model(**keys)
    with pytest.raises(ResultsError, match=said):
        _check(cast(Results, SimpleNamespace(name="r.sqlite", dimension=2)), model)


def test_a_model_of_no_material_is_refused() -> None:
    text = '{"physics": "diffusion", "medium": null, "material": null, "nodes": []}'
    results = SimpleNamespace(name="r.sqlite", dimension=2, decoded={}, model=lambda: text)
    with pytest.raises(ResultsError, match=naming("material", "medium")):
        whole(cast(Results, results))
