"""What a study.toml says becomes runs; what it must not say is refused in one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from messages import naming

from pdsolve.study.description import Case, Study, StudyError, read_study


def study(folder: Path, text: str) -> Study:
    """The study of this text, beside a drawing."""
    (folder / "plate.py").write_text("length = 0.05  # m: of the plate\n")
    path = folder / "study.toml"
    path.write_text(f'drawing = "plate.py"\n{text}')
    return read_study(path)


def values(found: Study) -> list[dict]:
    return [case.values for case in found.cases()]


def test_a_grid_has_all_combinations(tmp_path: Path) -> None:
    found = study(tmp_path, "[vary]\nmode = ['thesis', 'conservative']\n[vary.model]\nmaterial.G0 = [1, 2.0, 3]")
    assert len(values(found)) == 6
    assert values(found)[0] == {"material.G0": 1, "mode": "thesis"}
    assert found.varied == ["material.G0", "mode"]
    assert found.drawing == tmp_path / "plate.py"


def test_a_list_is_laid_over_what_is_the_same_in_all(tmp_path: Path) -> None:
    text = """
set.drawing.length = 1.0
set.precision = "float32"
[[runs]]
[[runs]]
drawing.length = 2.0
model."run.steps" = 7
[vary]
kernel = ["listed"]
"""
    same = {"precision": "float32", "kernel": "listed"}
    assert values(study(tmp_path, text)) == [
        {"drawing length": 1.0} | same,
        {"drawing length": 2.0, "run.steps": 7} | same,
    ]


def test_repetitions_are_told_apart_but_for_the_first(tmp_path: Path) -> None:
    found = study(tmp_path, "[repeat]\ntimes = 3\nnotch = 0.2\nseed = 4")
    plain, once, twice = found.cases()
    assert [case.repetition for case in (plain, once, twice)] == [0, 1, 2]
    assert len({plain.key, once.key, twice.key}) == 3
    other = study(tmp_path, "[repeat]\ntimes = 5\nnotch = 0.3\nseed = 4").cases()
    assert other[0].key == plain.key  # undisturbed: the same run
    assert other[1].key != once.key


def test_the_same_number_is_the_same_run_however_written() -> None:
    one, other = (Case({}, {"material.G0": number}, {}) for number in (204, 204.0))
    assert one.key == other.key
    assert Case({}, {"a": True}, {}).key != Case({}, {"a": 1}, {}).key


def test_values_are_words_as_the_command_line_has_them() -> None:
    case = Case({"Grown": True, "law": "x y", "n": 3}, {"run.fields": ["ux"], "keep": False, "law": "brittle"}, {})
    assert case.assignments("drawing") == [("Grown", "1"), ("law", "x y"), ("n", "3")]
    assert case.assignments("model") == [("run.fields", '["ux"]'), ("keep", "false"), ("law", '"brittle"')]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("repeat.times = 3", naming("$.repeat", found="3 times")),
        ("repeat.times = 0", re.escape("$.repeat.times is 0")),
        ("repeat.noise = 0.5", re.escape("$.repeat.noise is 0.5")),
        ("vary.model.material.G0 = 3", naming("material.G0", "$.vary", found="3", expected=("list", "values"))),
        ("vary.drawing.length = []", naming("length", "$.vary", found="[]", expected=("list", "values"))),
        ("vary.mode = ['quick']", re.escape(" is 'quick'")),
        ("varied.mode = ['thesis']", re.escape(".varied is unknown")),
        (
            f"vary.model.material.G0 = [{10**400}]",
            naming("$.vary.model.material.G0[0]", found="1329 bits", expected="1.8e308"),
        ),
        (
            "vary.drawing.length = [1979-05-27]",
            naming("$.vary.drawing.length[0]", found="1979-05-27", expected=("number", "word")),
        ),
        ("set.threads = 3", re.escape(".threads is unknown")),
        ("set = ", naming("not valid TOML", "invalid value", expected="correct")),
        (
            f"vary.model.a = {list(range(400))}\nvary.model.b = {list(range(400))}",
            naming(found="160000 runs"),
        ),
    ],
)
def test_what_is_no_study_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(StudyError) as error:
        study(tmp_path, text)
    assert re.search(said, str(error.value))
    assert str(error.value).startswith(f"{tmp_path / 'study.toml'}")


def test_a_drawing_that_is_missing_is_refused(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text('drawing = "none.geo"')
    with pytest.raises(StudyError, match=naming("$.drawing", found="none.geo", expected="drawing")):
        read_study(tmp_path / "study.toml")
    with pytest.raises(StudyError, match=naming("other.toml", "there is no such file")):
        read_study(tmp_path / "other.toml")


RANDOM = """
[repeat]
times = 1000
seed = 3
[random.drawing]
length = {weibull = [2.0, 8.0]}
[random.model]
material.E = {normal = [70e9, 7e9]}
material.G0.lognormal = [100, 0.2]
run.damping = {uniform = [1, 3]}
"""


def test_random_parameters_are_drawn_for_each_repetition(tmp_path: Path) -> None:
    found = study(tmp_path, RANDOM)
    cases = found.cases()
    drawn = {name: np.array([case.values[name] for case in cases]) for name in found.random}
    assert list(drawn) == ["drawing length", "material.E", "material.G0", "run.damping"]
    assert found.varied == []  # they are no series
    E, G0, damping, length = (drawn[name] for name in ("material.E", "material.G0", "run.damping", "drawing length"))
    assert E.mean() == pytest.approx(70e9, rel=0.01)  # the standard error is 3e-3
    assert E.std() == pytest.approx(7e9, rel=0.08)
    assert np.median(G0) == pytest.approx(100, rel=0.03)
    assert np.log(G0).std() == pytest.approx(0.2, rel=0.08)
    assert 1 <= damping.min() < 1.01
    assert 2.99 < damping.max() <= 3
    assert length.mean() == pytest.approx(2 * 0.94174, rel=0.015)  # 2 gamma(1 + 1/8)
    assert abs(np.corrcoef([E, G0, damping, length]) - np.eye(4)).max() < 0.12


def test_another_random_parameter_changes_no_draw(tmp_path: Path) -> None:
    text = "[repeat]\ntimes = 3\n[random.model]\nmaterial.E = {uniform = [1, 2]}\n"
    alone = [row["material.E"] for row in values(study(tmp_path, text))]
    both = [row["material.E"] for row in values(study(tmp_path, f"{text}material.G0 = {{uniform = [1, 2]}}"))]
    assert alone == both
    assert len(set(alone)) == 3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[measures]\npeak = {}", ("$.measures.peak", "peak_force")),
        ("[measures]\npeak = {peak_force = 'a', sql = 'SELECT 1'}", ("$.measures.peak", "2 quantities")),
        ("[measures]\npeak = {peak_force = 'a', thickness = 0}", ("$.measures[...].thickness", "above 0")),
        ("[measures]\nK = {intensity = 'K1', thickness = 0.1}", ("$.measures.K.thickness", "peak_force")),
        ("[measures]\nWork = {sql = 'SELECT 1'}", ("$.measures.Work", "another name")),
        (
            "[vary.model]\nmaterial.G0 = [1]\n[measures]\n'Material.G0' = {sql = 'SELECT 1'}",
            ("Material.G0", "another name"),
        ),
        ("[measures]\na = {intensity = 'K1'}\nA = {intensity = 'K1'}", ("$.measures.A", "another name")),
        ("[set.model]\nmaterial.E = 1\n[random.model]\nmaterial.E = {normal = [1, 2]}", ("material.E", "$.set")),
        ("[[runs]]\nmodel.material.E = 1\n[random.model]\nmaterial.E = {normal = [1, 2]}", ("material.E", "$.runs")),
        ("[measures]\npeak = {cycles = 'total', unit = 'm'}", ("$.measures.peak.unit", "cycles")),
        ("[measures]\npeak = {cycles = 'all'}", ("cycles", "total")),
        ("[random.model]\nmaterial.E = {normal = [1, 0]}", ("material.E", "above 0")),
        ("[random.model]\nmaterial.E = {uniform = [2, 1]}", ("material.E", "smaller number first")),
        ("[random.model]\nmaterial.E = {uniform = [2, inf]}", ("material.E", "finite")),
        ("[random.model]\nmaterial.E = {normal = [1, 2], uniform = [1, 2]}", ("material.E", "2 distributions")),
        ("[vary.model]\nmaterial.E = [1]\n[random.model]\nmaterial.E = {normal = [1, 2]}", ("material.E", "$.vary")),
    ],
)
def test_measures_and_distributions_that_are_none_are_refused(
    tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    with pytest.raises(StudyError) as error:
        study(tmp_path, text)
    assert all(word in str(error.value) for word in words), error.value
