"""What the physical groups of a drawing mean: "KIND:NAME", a name that parameters use, or nothing."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from pdmesh.drawing.parameters import PREFIX, Parameters
from pdmesh.scene.shapes import SceneError
from pdmesh.spelling import nearest

SHAPES = ("Point", "Curve", "Surface", "Volume")
PICKED = ("Box", "Edge", "Face", "Node")  # parameters that place a condition without a group
LIKE = 0.7  # least similarity of a misspelt kind before a colon
MOST = 8  # groups that a note names
LONGEST = 60  # letters of a name in a message
ALMOST = re.compile(r"\s*([A-Za-z]+)\s*([:/]|[\s_.=|-]|$)\s*(.*)", re.DOTALL)

Kinds = Mapping[str, tuple[tuple[int, ...], str | None]]  # dimensions of a kind, and the folder of its parameters


class Physical(NamedTuple):
    """A physical group: its name, which may be empty, its dimension and its number."""

    name: str
    dimension: int
    number: int

    def __str__(self) -> str:
        name = self.name if len(self.name) <= LONGEST else f"{self.name[:LONGEST]}..."
        called = f'"{name}"' if name else self.number
        return f"Physical {SHAPES[self.dimension]}({called})"


class Meaning(NamedTuple):
    """The groups of each kind by name, as places in the list of groups, and a note about those that are not used."""

    groups: dict[str, dict[str, int]]
    notes: tuple[str, ...]


def meaning(
    groups: Sequence[Physical],
    zones: Sequence[Mapping[str, Any]],
    kinds: Kinds,
    parameters: Parameters,
    of_plates: Collection[str] = (),
) -> Meaning:
    """What groups mean where these `kinds` exist; `of_plates` are kinds that a body lacks.

    `zones` are those that the reader made (`sandbox.zone_groups`). Raises SceneError for a name that is almost one of
    a kind, and for parameters without a group.
    """
    places_by_kind: dict[str, dict[str, int]] = {kind: {} for kind in kinds}
    others = []
    for place, group in enumerate(groups):
        kind, _, name = group.name.partition(":")
        if kind not in kinds or not name:
            others.append(place)
            continue
        if group.dimension not in kinds[kind][0]:
            raise _refused(group, kind, name, kinds)
        if kinds[kind][1] and "/" in name:
            raise SceneError(f"{group}: the name has a '/' and is used by parameters too; use a name without '/'")
        if name in places_by_kind[kind]:
            first_shape, second_shape = (
                SHAPES[physical_group.dimension].lower()
                for physical_group in (groups[places_by_kind[kind][name]], group)
            )
            raise SceneError(f'group "{group.name}" is both a {first_shape} and a {second_shape}; use one of them')
        places_by_kind[kind][name] = place
    ours = sum(map(len, places_by_kind.values())) > len(zones)
    for place in others:
        _refuse_almost(groups[place], kinds, of_plates, ours)
    zoned = {(kinds["zone"][0][0], number) for zone in zones for number in zone["groups"]}
    used = [_use(groups[place], place, places_by_kind, kinds, parameters) for place in others]
    unused = [place for place, use in zip(others, used, strict=True) if not use and groups[place][1:] not in zoned]
    _refuse_missing(places_by_kind, kinds, parameters)
    for zone in zones:
        spacing = f"Zones/{zone['name']}/Spacing"
        if parameters.maybe(spacing) is None:
            raise SceneError(
                f"zones: there is none, and no parameter '{PREFIX}{spacing}'; add a group 'zone:NAME', or a spacing"
                f" for all {SHAPES[kinds['zone'][0][0]].lower()}s (--set {spacing}=...)"
            )
    return Meaning(places_by_kind, tuple(_notes(groups, zones, unused, kinds)))


def picked(parameters: Parameters, folder: str) -> tuple[str, ...]:
    """Which of the parameters that place a condition without a group a folder has."""
    return tuple(word for word in PICKED if parameters.text(f"{folder}/{word}"))


def _almost(name: str, kinds: Kinds) -> tuple[str, str, str]:
    """The kind that a name seems to begin with, what separates it from the rest, and the rest; no kind if none."""
    parts = ALMOST.fullmatch(name)
    if parts is None:
        return "", "", ""
    word = parts[1].lower()
    folders = {str(folder).lower(): kind for kind, (_, folder) in kinds.items() if folder}
    alias = {f"{kind}s": kind for kind in kinds} | folders | {kind: kind for kind in kinds}
    kind = alias.get(word, nearest(word, kinds, LIKE) if parts[2] == ":" else "")
    return kind, parts[2].strip(), parts[3]


def _refuse_almost(group: Physical, kinds: Kinds, of_plates: Collection[str], ours: bool) -> None:
    """Raise SceneError for a name with a colon or a slash behind what seems to be a kind, and for a kind alone in
    drawings with groups of `ours`."""
    word, colon, name = group.name.partition(":")
    if word in of_plates and colon and name:
        raise SceneError(f"{group}: '{word}:' cannot be used in a body in space; use one of {', '.join(kinds)}")
    kind, separator, rest = _almost(group.name, kinds)
    if kind and (separator in (":", "/") if separator else ours and group.name == kind):
        raise _refused(group, kind, rest, kinds)


def _refused(group: Physical, kind: str, name: str, kinds: Kinds) -> SceneError:
    forms = " or ".join(SHAPES[dimension] for dimension in kinds[kind][0])
    return SceneError(f'{group} has the wrong dimension or form; use Physical {forms}("{kind}:{name or "NAME"}")')


def _use(
    group: Physical, place: int, places_by_kind: dict[str, dict[str, int]], kinds: Kinds, parameters: Parameters
) -> bool:
    """Whether parameters name a group without a kind, which then is of that kind."""
    used = False
    for kind, (dimensions, folder) in kinds.items():
        named = folder and group.dimension in dimensions and group.name in parameters.below(folder)
        if named and group.name not in places_by_kind[kind] and not picked(parameters, f"{folder}/{group.name}"):
            places_by_kind[kind][group.name] = place
            used = True
    return used


def _refuse_missing(places_by_kind: dict[str, dict[str, int]], kinds: Kinds, parameters: Parameters) -> None:
    for kind, (dimensions, folder) in kinds.items():
        if not folder:
            continue
        for name in places_by_kind[kind]:
            for word in picked(parameters, f"{folder}/{name}"):
                raise SceneError(
                    f"parameter '{PREFIX}{folder}/{name}/{word}' cannot be combined with a group '{kind}:{name}';"
                    " use one of them"
                )
        missing = sorted(parameters.below(folder) - set(places_by_kind[kind]))
        if kind == "zone" and not places_by_kind[kind] and len(missing) == 1:
            return  # of a drawing without shapes, as any shape would be this zone
        for name in missing:
            if picked(parameters, f"{folder}/{name}"):
                continue
            near = nearest(name, places_by_kind[kind])
            meant = f" (or is {PREFIX}{folder}/{near} meant?)" if near else ""
            edge = f", or {PREFIX}{folder}/{name}/Edge" if 1 in dimensions else ""
            raise SceneError(
                f'Physical {SHAPES[dimensions[0]]}("{kind}:{name}") is missing; draw it for'
                f" {PREFIX}{folder}/{name}{meant}{edge}"
            )


def _notes(
    groups: Sequence[Physical], zones: Sequence[Mapping[str, Any]], unused: Sequence[int], kinds: Kinds
) -> Iterator[str]:
    (dimension,) = kinds["zone"][0]
    shapes = f"{SHAPES[dimension].lower()}s"
    for zone in zones:
        parts = [str(group) for group in groups if group.dimension == dimension and group.number in zone["groups"]]
        what = f"the {shapes} of {_listed(parts)}" if parts else f"all {shapes}"
        yield f"zone '{zone['name']}': {what} (no group has the name zone:{zone['name']})"
    if unused:
        shown = []
        for place in unused:
            kind, _, rest = _almost(groups[place].name, kinds)
            meant = f' (is "{kind}:{rest or "NAME"}" meant?)' if kind else ""
            shown.append(f"{groups[place]}{meant}")
        yield f"not used: {_listed(shown)}"


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MOST
    return ", ".join(names[:MOST]) + (f" and {more} more groups" if more > 0 else "")
