"""The thesis's door database (Fig. 4.1): one YAML mapping, a door a key.

    1:
      position:
        x: 2.0
        y: 1.5
        theta: 0.0
      width: 0.9
      status: CLOSED
      closed_prob: 0.7
      open_prob: 0.3

Metres and radians. It knows the states OPEN, CLOSED and UNKNOWN only. Files of others may say more:
a door's other keys with a single value are kept as annotations, what else there is is named.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.model import doors as door_model
from semmap_log.errors import CommandError
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_yaml import Mapping, Node, Scalar, load_yaml
from semmap_log.interop.formats.parsing.yaml_values import Fields, described, mapping_of

SAVED_SUFFIX = "_saved"
"""Suffix of the folder next to a log where the server saves doors by default."""
PROB_KEYS = ("closed_prob", "open_prob")
DOOR_KEYS = ("position", "width", "status", *PROB_KEYS)
NAME = "name"
"""What a door is called is an annotation, and needs no word."""
POSITION_KEYS = ("x", "y", "theta")


def read_thesis_yaml(path: Path) -> DoorTable:
    """Return the doors of the file, in its order; an empty file has none.

    A status is in any case of letters; one that is none of the three is UNKNOWN, as the thesis's
    server has it, with a warning. A probability that is `.nan` is none, with a warning.

    Raises:
        FormatError: The file cannot be read, or is not such a database.
    """
    return parse_thesis_yaml(load_yaml(path, takes_nan=True), path)


def parse_thesis_yaml(root: Node, path: Path) -> DoorTable:
    """Return the doors of a YAML tree; `path` is for messages.

    Raises:
        FormatError: It is not such a database.
    """
    if isinstance(root, Scalar) and root.value is None:
        return DoorTable(path, ())
    reader = _Reader(Problems(path), [], {}, {})
    doors = reader.doors(root)
    reader.problems.raise_any()
    return DoorTable(
        path,
        tuple(doors),
        left_out=tuple(_told(path, reader.left_out)),
        warnings=(*reader.warnings, *_told(path, reader.kept)),
    )


def dump_thesis_yaml(
    door_map: door_model.DoorMap, *, default_prob: float | None = None, is_partial: bool = False
) -> tuple[str, list[str]]:
    """Return the text of the file, ids ascending, and what it leaves out of which doors and why.

    Numbers are written so that reading gives exactly the same ones. All states but OPEN and
    CLOSED are written as UNKNOWN. What is no door has no place in it.

    Args:
        door_map: The doors.
        default_prob: What to write where a door has no probability; None: that is an error.
        is_partial: Without a default such a door's line is left out instead: we read that as not
            given, the thesis's own server cannot read it.

    Raises:
        CommandError: Doors without probabilities, no `default_prob`, and not `is_partial`.
    """
    if default_prob is not None and not 0 <= default_prob <= 1:
        raise CommandError(f"--default-prob: expected a number from 0 to 1, got {default_prob!r}.")
    objects = [door for _, door in sorted(door_map.doors.items())]
    doors = [door for door in objects if door.object_class.is_door]
    placed = [door for door in doors if door.is_placed]
    lacking = _without_probabilities(placed) if default_prob is None else []
    if lacking and not is_partial:
        raise CommandError(
            f"{'; '.join(lacking)}. The thesis's YAML needs both probabilities: give what to write "
            "with --default-prob P, such as --default-prob 0.5."
        )
    text = "".join(
        _entry(door, door_model.NAN if default_prob is None else default_prob) for door in placed
    )
    left_out = [
        f"{_named(door)}: has no position, which this format needs"
        for door in doors
        if not door.is_placed
    ]
    left_out += [
        f"{_named(door)}: is no door, and this format knows nothing else"
        for door in objects
        if not door.object_class.is_door
    ]
    return text or "{}\n", left_out + lacking


_ID = re.compile(r"0|[1-9][0-9]{0,9}")


@dataclass(frozen=True, slots=True)
class _Reader:
    """Takes doors out of the tree and notes what is wrong with them."""

    problems: Problems
    warnings: list[str]
    kept: dict[str, list[int]]
    """Message about keys that the format does not have -> their lines; kept as annotations."""
    left_out: dict[str, list[int]]
    """The same of keys that are not kept."""

    def doors(self, root: Node) -> list[TableDoor]:
        table = mapping_of(root, "a door database", self.problems)
        doors = []
        entries = table.entries if table else {}
        has_doors = any(map(_is_door, entries.values()))
        for key, node in entries.items():
            if not _ID.fullmatch(key) or int(key) > door_model.MAX_DOOR_ID:
                assert table is not None
                if has_doors and not _is_door(node):
                    self.left_out[f"the key {shown(key)} is no door's id"] = [table.key_lines[key]]
                    continue
                self.problems.add(
                    table.key_lines[key],
                    f"expected a door's id, a whole number from 0 to {door_model.MAX_DOOR_ID}, "
                    f"got {shown(key)}",
                )
                continue
            entry = mapping_of(node, f"door {key}", self.problems)
            if entry is not None:
                doors.append(
                    self.door(
                        door_model.DoorId(int(key)), Fields(f"door {key}", entry, self.problems)
                    )
                )
        return doors

    def door(self, door_id: door_model.DoorId, fields: Fields) -> TableDoor:
        x, y, theta = self.position(fields)
        width = fields.number("width")
        if width < 0:
            fields.refuse("width", "a number of metres, 0 or more")
        return TableDoor(
            line=fields.mapping.line,
            door_id=door_id,
            level=0,
            x=x,
            y=y,
            theta=theta,
            width=width,
            state=self.state(fields),
            prob_open=self.probability(fields, "open_prob"),
            prob_closed=self.probability(fields, "closed_prob"),
            annotations=self.annotations(fields),
        )

    def annotations(self, fields: Fields) -> dict[str, str]:
        """Return the keys of a door that the format does not have, as annotations."""
        found = {}
        for key, node in fields.others(DOOR_KEYS).items():
            none = f"the key {shown(key)} is unknown for a door (expected {', '.join(DOOR_KEYS)})"
            if key and isinstance(node, Scalar) and node.value not in (None, ""):
                found[key] = node.text
                if key == NAME:
                    continue
                told = self.kept.setdefault(f"{none}; kept as an annotation", [])
            else:
                told = self.left_out.setdefault(f"{none}, and has no single value", [])
            told.append(fields.mapping.key_lines[key])
        return found

    def position(self, fields: Fields) -> tuple[float, float, float]:
        node = fields.node("position")
        position = mapping_of(node, f"{fields.what}: position", self.problems) if node else None
        if position is None:
            return door_model.NAN, door_model.NAN, door_model.NAN
        parts = Fields(f"{fields.what}: position", position, self.problems)
        for key in parts.others(POSITION_KEYS):
            expected = ", ".join(POSITION_KEYS)
            none = f"the key {shown(key)} is unknown for a position (expected {expected})"
            self.left_out.setdefault(none, []).append(position.key_lines[key])
        return parts.number("x"), parts.number("y"), parts.number("theta")

    def probability(self, fields: Fields, key: str) -> float:
        node = fields.mapping.entries.get(key)
        if node is None:
            return door_model.NAN
        if isinstance(node, Scalar) and node.text.lower().lstrip(".") == "nan":
            self.warnings.append(
                f"{self.problems.path}:{node.line}: {fields.what}: {key}: expected a number from 0 "
                f"to 1, got {described(node)}; taken for none"
            )
            return door_model.NAN
        value = fields.number(key)
        if not (math.isnan(value) or 0 <= value <= 1):
            fields.refuse(key, "a number from 0 to 1")
        return value

    def state(self, fields: Fields) -> door_model.DoorState | None:
        node = fields.mapping.entries.get("status")
        if node is None:
            return None
        known = door_model.thesis_state(node.text) if isinstance(node, Scalar) else None
        if known is not None:
            return known
        self.warnings.append(
            f"{self.problems.path}:{node.line}: {fields.what}: status: expected one of "
            f"{', '.join(door_model.THESIS_STATES)}, got {described(node)}; taken for UNKNOWN"
        )
        return door_model.DoorState.UNKNOWN


def _is_door(node: Node) -> bool:
    return isinstance(node, Mapping) and "position" in node.entries


def _told(path: Path, lines_of: dict[str, list[int]]) -> Iterator[str]:
    """Yield each thing that was noted, once, with the first of its lines."""
    for text, lines in lines_of.items():
        more = f" and {len(lines) - 1} more" if len(lines) > 1 else ""
        yield f"{path}:{lines[0]}{more}: {text}"


def _entry(door: door_model.Door, default_prob: float) -> str:
    probs = ""
    for key, given in zip(PROB_KEYS, (door.prob_closed, door.prob_open), strict=True):
        prob = default_prob if math.isnan(given) else given
        probs += "" if math.isnan(prob) else f"  {key}: {float(prob)!r}\n"
    return (
        f"{door.door_id}:\n"
        "  position:\n"
        f"    x: {float(door.x)!r}\n"
        f"    y: {float(door.y)!r}\n"
        f"    theta: {float(door.theta)!r}\n"
        f"  width: {float(door.width)!r}\n"
        f"  status: {door_model.reduced(door.state).name}\n"
        f"{probs}"
    )


def _without_probabilities(doors: list[door_model.Door]) -> list[str]:
    """Return of each probability which doors have none, in words."""
    said = []
    for key, prob in zip(PROB_KEYS, ("prob_closed", "prob_open"), strict=True):
        lacking = [_named(door) for door in doors if math.isnan(getattr(door, prob))]
        if lacking:
            more = f" and {len(lacking) - MOST_NAMED} more" if len(lacking) > MOST_NAMED else ""
            said.append(f"{key} is not given: {', '.join(lacking[:MOST_NAMED])}{more}")
    return said


MOST_NAMED = 10


def _named(door: door_model.Door) -> str:
    said = f"{door.object_class.name} {door.door_id}"
    return f"{said} ({door.name})" if door.name else said
