"""What a reader does is named where it takes too long."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import BinaryIO

import pytest

from pdmesh import SceneError
from pdmesh.drawing.sandbox import child, surface_triangles
from pdmesh.drawing.sandbox.walls import STAGE


@pytest.mark.skipif(child.OUT_OF_TIME is None, reason="no limit of processor time there")
@pytest.mark.parametrize(
    ("is_busy", "limit"), [(True, "after 60 s of processor time"), (False, "after waiting for 600 s")]
)
def test_what_takes_too_long_is_named(
    is_busy: bool, limit: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last stage, not the first."""

    def run(*words: object, stderr: BinaryIO, timeout: float, **__: object) -> SimpleNamespace:
        assert timeout == child.PATIENCE * 60.0
        stderr.write(f"{STAGE}reading\n{STAGE}triangulating its 6 surfaces to 0.01\nInfo: 12 triangles\n".encode())
        if not is_busy:
            raise child.subprocess.TimeoutExpired("reader", timeout)
        assert child.OUT_OF_TIME is not None
        return SimpleNamespace(returncode=-child.OUT_OF_TIME)

    monkeypatch.setattr(child.subprocess, "run", run)
    with pytest.raises(
        SceneError, match=f"a.geo: Gmsh was still triangulating its 6 surfaces to 0.01 {limit}.*; simplify the shapes"
    ):
        child.run_reader("reader", "Gmsh", tmp_path / "a.geo", {}, tmp_path / "result.json", 60.0, None)


def test_a_body_is_said_to_be_joined_then_triangulated(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before each of them begins, as it may not end."""

    class StopError(Exception):
        """In place of what takes long."""

    def stop(*_: object) -> None:
        raise StopError

    model = SimpleNamespace(getEntities=lambda _: [(2, tag) for tag in range(6)], getType=lambda *_: "Plane")
    fake = SimpleNamespace(model=model, logger=SimpleNamespace(get=list))
    model.occ = SimpleNamespace(getEntities=model.getEntities)
    monkeypatch.setattr(surface_triangles, "_physical", lambda _: [])
    monkeypatch.setattr(surface_triangles, "_mean_side", lambda *_: 1.0)
    stages = ["joining the zones", "triangulating its 6 surfaces to 0.01"]
    for name, count in (("_united", 1), ("_drawn", 2)):
        with monkeypatch.context() as patch:
            patch.setattr(surface_triangles, "_united", lambda *_: [])
            patch.setattr(surface_triangles, name, stop)
            with pytest.raises(StopError):
                surface_triangles.spatial_groups(fake, 0.01, False)
        assert capsys.readouterr().err.splitlines() == [f"{STAGE}{stage}" for stage in stages[:count]]
