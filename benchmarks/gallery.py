"""The gallery of the site: every shipped scene, built, solved and drawn by the commands that stand below its picture.

`python -m benchmarks.gallery` writes docs/gallery.md and its pictures; names of scenes draw those alone. `--stale`
draws those whose scene, commands or drawing code have changed since the picture was written: docs/gallery/pictures.json
records these, and a test compares them. Results stay in build/gallery; a scene that has not changed is not solved
again. A scene that takes minutes is solved in a coarser form, as its commands say. What its picture shows, its
equation, its source and what was measured stand in benchmarks/gallery_texts.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image

from benchmarks.pages import DOCS, markdown_table, write_block
from benchmarks.picture_outline import mark
from pdsolve.results import Results

ROOT = DOCS.parent
PAGE = DOCS / "gallery.md"
RECORDS = DOCS / "gallery" / "pictures.json"  # of what text, command and drawing code each picture is
RESULTS = ROOT / "build" / "gallery"
NAMES = {  # of people, materials and shapes, as a heading has them
    "kalthoff winkler": "Kalthoff-Winkler",
    "duran50": "Duran 50",
    "duran metre": "Duran glass, one metre",
    "cook ": "Cook's ",
    "nooru mohamed": "Nooru-Mohamed",
    "l panel": "L-shaped panel",
    "v notch": "V-notch",
    "soda lime": "soda-lime glass",
    "figure 18": "bracket",
    "figure 19": "plate with holes and inclusion",
}
TEXTS = Path(__file__).parent / "gallery_texts.md"
WIDE = 720  # pixels of a picture
ACROSS = 3  # pictures in a row of the table
FRONT = (  # of the table: unlike each other
    *("kalthoff_winkler_steel", "figure_18", "duran_metre", "branching_block", "drying_mud", "compact_tension"),
    *("hot_disc", "slanted_notch", "bent_square", "expanding_ring", "nooru_mohamed", "quenched_slab"),
)


class Shown(NamedTuple):
    """How a scene is shown."""

    picture: str = "damage"  # the command of pdpost, with its options
    build: str = ""  # options of pdmesh
    solve: str = ""  # options of pdsolve


SHOWN = {
    "ball_through_glass.py": Shown("slice --field damage --plane z=-0.0035"),
    "bar.py": Shown("displacement --component x"),
    "branched_fragments.py": Shown("damage"),
    "branching_block.py": Shown("crack"),
    "beam_on_rollers.py": Shown("stress --component xx --scale auto"),
    "bending.py": Shown("stress --component xx --scale auto"),
    "bent_square.py": Shown("stress --scale 1"),
    "colliding_fragments.py": Shown("damage"),
    "compact_tension.py": Shown("stress --scale auto"),
    "disc.geo": Shown("content --time 500"),
    "drop_weight.py": Shown("reaction --condition hammer"),
    "duran_metre.py": Shown("damage --largest 0.5", "--set spacing=2e-3"),
    "fatigue_compact_tension.py": Shown("fatigue"),
    "expanding_ring.py": Shown("crack"),
    "figure_18.geo": Shown("stress --largest 4e7"),
    "figure_19.py": Shown("stress --largest 4e7"),
    "brazilian_disc.py": Shown("damage", "--set spacing=0.004"),
    "brazilian_platens.py": Shown("damage --scale auto"),
    "cook_membrane.py": Shown("displacement --scale auto"),
    "double_cantilever.py": Shown("sif"),
    "graded_bar.py": Shown("strain --component xx"),
    "hot_disc.py": Shown("stress"),
    "kalthoff_winkler_steel.py": Shown("damage --largest 0.5", "--adapt hybrid --set spacing=5e-4"),
    "kalthoff_winkler_block.py": Shown("slice --field damage --plane z=0"),
    "kalthoff_winkler_projectile.py": Shown("velocity"),
    "notched_beam.py": Shown("reaction --condition middle"),
    "nooru_mohamed.py": Shown("displacement --scale auto"),
    "offset_notch.py": Shown("reaction --gap mouth --condition middle"),
    "inclined_penny.py": Shown("crack"),
    "lug.geo": Shown("crack"),
    "penny.geo": Shown("slice --field damage --plane y=0"),
    "cracking_disc.py": Shown("damage --largest 0.5"),
    "quenched_slab.py": Shown("damage --largest 0.5"),
    "pressurized_crack.py": Shown("displacement --component y --scale auto"),
    "plastic_beam.py": Shown("plastic --scale auto"),
    "rubber_block.py": Shown("stress --scale 1"),
    "surfing_crack.py": Shown("sif"),
    "screw.geo": Shown("slice --field content --plane y=0 --time 500"),
    "slanted_notch.py": Shown("crack"),
    "strip.py": Shown("stress"),
}


class OwnRun(NamedTuple):
    """A run of a scene that the gallery has not."""

    name: str  # of its results
    build: str  # options of pdmesh
    solve: str = ""  # options of pdsolve


class Further(NamedTuple):
    """A picture of another page."""

    scene: str
    picture: str  # the command of pdpost, with its options, or `preview` of pdmesh
    runs: tuple[OwnRun, ...] = ()  # what it shows, if that is not the gallery's run

    @property
    def command(self) -> str:
        """The command that draws it, and those of its own runs."""
        return "; ".join((self.picture, *(f"{run.build} {run.solve}".strip() for run in self.runs)))


README_RUN = (
    '--adapt hybrid --set "Loads/top/Traction y=18e6" --set "Loads/bottom/Traction y=-18e6"'
    " --set Zones/fine/Spacing=5e-5 --set Zones/coarse/Spacing=1e-4"
)
SPACINGS = ("1", "0.5", "0.25")  # mm, of the struck plates that are compared
FURTHER = {  # those of `NEED_RENDER` need PyVista
    "ball_through_glass.gif": Further(
        "ball_through_glass.py", "animate --plane z=-0.0035 --stride 2 --style savefig.dpi=70"
    ),
    "branching_block.png": Further("branching_block.py", "damage --clip y=0"),
    "compare.png": Further(
        "kalthoff_winkler_steel.py",
        f'compare --titles "{",".join(f"{spacing} mm" for spacing in SPACINGS)}" --hide zone --largest 0.5',
        tuple(OwnRun(f"{spacing}mm", f"--adapt hybrid --set spacing={spacing}mm") for spacing in SPACINGS),
    ),
    "disc.png": Further("disc.geo", "content --time 500"),
    "drying_mud.gif": Further("drying_mud.py", "animate"),
    "duran50_crack.png": Further("duran50.geo", "crack"),
    "figure_19.png": Further("figure_19.py", "preview"),
    "fork.gif": Further(
        "duran50.geo",
        "animate --field stress --largest 5e7",
        (OwnRun("fork", README_RUN, "--set run.time_step=1.25e-8 --set run.steps=2880"),),
    ),
    "screw.png": Further("screw.geo", "render --field solid --level 0.5 --time 500"),
}
NEED_RENDER = ("branching_block.png", "screw.png")
WIDER = 1000  # pixels of a picture of another page
HIGHEST = 1200
COMMENT = re.compile(r"[ \t]*(?:#|//).*")


def commands(scene: Path) -> list[str]:
    """What a user types to see a scene."""
    shown = SHOWN.get(scene.name, Shown())
    name = scene.stem
    return [
        " ".join(filter(None, words))
        for words in (
            ("pdmesh build", f"geometries/{scene.name}", "--trust" * (scene.suffix == ".py"), shown.build),
            ("pdsolve", f"{name}.json", shown.solve),
            ("pdpost", shown.picture.replace(" ", f" {name}.sqlite ", 1))
            if " " in shown.picture
            else ("pdpost", shown.picture, f"{name}.sqlite"),
        )
    ]


def caption(scene: Path) -> str:
    """The first sentence of a scene's file, which says what it is."""
    text = re.sub(r"^(//|\"\"\") ?", "", scene.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return " ".join(text.split("\n\n")[0].split())


def draw(scene: Path) -> None:
    """Write the picture of a scene and what it is of; solve the scene unless it is. Raises CalledProcessError."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    if not (RESULTS / "geometries").exists():
        (RESULTS / "geometries").symlink_to(ROOT / "geometries")
    solved = RESULTS / f"{scene.stem}.of"
    is_solved = solved.exists() and solved.read_text(encoding="utf-8") == scene_mark(scene)
    for line in commands(scene)[2 if is_solved else 0 :]:
        program, *options = line.split()
        where = ["-o", f"{scene.stem}.png"] if program == "pdpost" else []
        _call([program, *options, "-q", "--force", *where])
        if program == "pdsolve":
            solved.write_text(scene_mark(scene), encoding="utf-8")
    _shrink(RESULTS / f"{scene.stem}.png", picture_of(scene), WIDE)
    with Results.open(RESULTS / f"{scene.stem}.sqlite") as results:
        dimension = results.dimension
    picture = SHOWN.get(scene.name, Shown()).picture
    record({scene.stem: {"dimension": dimension, **marks(scene, picture, dimension)}})
    for name, further in FURTHER.items():
        if further.scene == scene.name and not (name in NEED_RENDER and find_spec("pyvista") is None):
            draw_further(scene, name, further)
            record({name: {"dimension": dimension, **marks(scene, further.command, dimension)}})


def draw_further(scene: Path, name: str, further: Further) -> None:
    """Write a picture of another page, of the gallery's run or of its own runs. Raises CalledProcessError."""
    trusted = ["--trust"] * (scene.suffix == ".py")
    drawing, drawn = f"geometries/{scene.name}", f"further_{name}"
    for run in further.runs:
        grid = ["-o", f"{run.name}.json", "-q", "--force"]
        _call(["pdmesh", "build", drawing, *trusted, *shlex.split(run.build), *grid])
        _call(["pdsolve", f"{run.name}.json", *run.solve.split(), "-q", "--force"])
    first, *options = shlex.split(further.picture)
    if first == "preview":
        _call(["pdmesh", first, drawing, *trusted, "-q", "--force", "-o", drawn])
    else:
        databases = [f"{run.name}.sqlite" for run in further.runs] or [f"{scene.stem}.sqlite"]
        _call(["pdpost", first, *databases, *options, "-q", "--force", "-o", drawn])
    if name.endswith(".png"):
        _shrink(RESULTS / drawn, DOCS / name, WIDER)
    else:
        shutil.copy(RESULTS / drawn, DOCS / name)


def _call(words: list[str]) -> None:
    """Run a command among the results."""
    subprocess.run([sys.executable, "-m", *words], cwd=RESULTS, check=True)


def _shrink(path: Path, small: Path, wide: int) -> None:
    """Write a picture `wide` pixels wide, or less if it is higher than wide."""
    image = Image.open(path).convert("RGB")
    wide = min(wide, round(HIGHEST * image.width / image.height))
    size = wide, round(image.height * wide / image.width)
    image.resize(size, Image.Resampling.LANCZOS).save(small, "png", optimize=True)


def record(new: dict[str, dict[str, Any]]) -> None:
    """Note what pictures are of."""
    records = recorded() | new
    lines = [f" {json.dumps(name)}: {json.dumps(noted)}" for name, noted in sorted(records.items())]
    RECORDS.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def scene_mark(scene: Path) -> str:
    """A mark of a scene's text without comments, and of the commands that build and solve it."""
    text = "\n".join([COMMENT.sub("", scene.read_text(encoding="utf-8")), *commands(scene)[:2]])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def marks(scene: Path, picture: str, dimension: int) -> dict[str, str]:
    """The marks that a picture of a scene has if it is drawn now by the command `picture`."""
    return {"scene": scene_mark(scene), "command": picture, "drawing": drawing_mark(picture, dimension)}


@lru_cache
def drawing_mark(picture: str, dimension: int) -> str:
    """The mark of what the command `picture` draws now."""
    with tempfile.TemporaryDirectory() as folder:
        return mark(picture, dimension, Path(folder))


def recorded() -> dict[str, dict[str, Any]]:
    """What each picture is of, by the name of its scene."""
    records: dict[str, dict[str, Any]] = json.loads(RECORDS.read_text(encoding="utf-8")) if RECORDS.exists() else {}
    return records


def is_stale(scene: Path) -> bool:
    """Whether the picture of a scene is of another text, command or drawing than the present ones."""
    pictures = {scene.stem: SHOWN.get(scene.name, Shown()).picture}
    pictures |= {name: further.command for name, further in FURTHER.items() if further.scene == scene.name}
    for name, picture in pictures.items():
        noted = recorded().get(name)
        if noted is None or any(noted[key] != now for key, now in marks(scene, picture, noted["dimension"]).items()):
            return True
    return not picture_of(scene).exists()


def picture_of(scene: Path) -> Path:
    """Where the picture of a scene is kept."""
    return ROOT / "docs" / "gallery" / f"{scene.stem}.png"


def texts() -> dict[str, str]:
    """What is said of each scene, by its name."""
    parts = re.split(r"^## ", TEXTS.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    return {name: text.strip() for name, _, text in (part.partition("\n") for part in parts)}


def title(scene: Path) -> str:
    """The heading of a scene, its name in words."""
    words = scene.stem.replace("_", " ")
    for plain, name in NAMES.items():
        words = words.replace(plain, name)
    return words[0].upper() + words[1:]


def front(scenes: list[Path]) -> str:
    """A table of pictures, each of which leads to its scene."""
    pictures = {}
    for scene in scenes:
        anchor = re.sub(r"[^\w -]", "", title(scene).lower()).replace(" ", "-")  # the address of its heading
        pictures[scene.stem] = f"[![{caption(scene)}](gallery/{scene.stem}.png)](#{anchor})"
    shown = [pictures[name] for name in FRONT]
    rows = [shown[at : at + ACROSS] for at in range(0, len(shown), ACROSS)]
    return markdown_table(rows[0], rows[1:])


def sections(scenes: list[Path]) -> str:
    """The table of pictures, and a section for each scene."""
    lines, explained = [front(scenes)], texts()
    for scene in scenes:
        picture = f"![{caption(scene)}](gallery/{scene.stem}.png)"
        lines += [f"## {title(scene)}", "", f"`geometries/{scene.name}`", "", picture, "", explained[scene.stem], ""]
        lines += ["```bash", *commands(scene), "```", ""]
    return "\n".join(lines).strip("\n")


def shipped() -> list[Path]:
    """All scenes, by their names."""
    return sorted(path for path in (ROOT / "geometries").iterdir() if path.suffix in (".geo", ".py"))


def main() -> None:
    """Draw what is asked for, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", help="names of scenes, such as duran50.geo (default: all)")
    parser.add_argument("--stale", action="store_true", help="draw those whose picture is not of the present state")
    args = parser.parse_args()
    asked, scenes = args.scenes, shipped()
    if unknown := sorted(set(asked) - {scene.name for scene in scenes}):
        parser.error(f"found {', '.join(unknown)}, expected some of {', '.join(scene.name for scene in scenes)}")
    for scene in scenes:
        if (not asked or scene.name in asked) and not (args.stale and not is_stale(scene)):
            print(scene.name, flush=True)
            draw(scene)
    write_block(PAGE, "scenes", sections(scenes))


if __name__ == "__main__":
    main()
