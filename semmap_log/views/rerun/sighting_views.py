"""Sightings by a laser in a rerun recording: for each door the latest visit at the cursor.

From the end of a visit until the end of the next, a view of the door shows its beams by their
outcome, the path of the laser, the door's line, the leaf where it most likely stands, and the
verdict. All of it stands along `happened` alone.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.visit import DoorLine, KeptVisit, Visit, VisitReader
from semmap_log.core.model.doors import DoorId
from semmap_log.core.texts import counted
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import BEAM_SHORT, Palette, Rgb
from semmap_log.views.rerun.drawable import drawable
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.scene import HAPPENED, EntityPath, RowWriter, Scene, SceneDoor, rgba
from semmap_log.views.sightings import visit_words

SIGHTINGS = "sightings"
MOST_DOORS = 24
"""Doors with a view by default; others have one on request."""
MOST_VISITS = 400
"""Of a door; of more, those that are worth a look."""
MOST_POINTS, MOST_BEAMS = 1000, 60
"""Of a visit."""
AROUND_M = 2.0
"""What is shown around a door, beyond its width."""
ASIDE_POINTS, TOLD_POINTS = 1.0, 2.2
"""Radius of where a beam ended, points of the screen."""
AT_ONCE = 64
"""Visits of a door that are written together: some MB."""
ROW = np.dtype([("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8")])


@dataclass(frozen=True, slots=True)
class SightingsShown:
    """Which visits a recording shows, and of which doors."""

    doors: tuple[DoorId, ...]
    """In the order of their views."""
    visits: frozenset[tuple[DoorId, int]]
    """Door, and when the visit ended."""
    lines: Mapping[DoorId, DoorLine]
    """Where each of the doors was at its last visit."""
    left_out: int
    """Visits that are kept, and not shown."""
    problems: tuple[str, ...]
    """Files that are truncated, or of another log."""
    read_visits: VisitReader
    """Reads them again, with their scans."""

    def has(self, visit: Visit) -> bool:
        """Return whether a visit is shown."""
        return (visit.door_id, visit.last_ns) in self.visits

    def __str__(self) -> str:
        """Return in words what is not shown; empty: nothing."""
        return f"{counted(self.left_out, 'sighting')} of doors" if self.left_out else ""


def sightings_to_show(
    reader: VisitReader, excerpt: Excerpt, scene: Scene, chosen: Collection[DoorId] | None
) -> SightingsShown | None:
    """Return what to show of the scans that are kept next to a log; None: nothing.

    Args:
        reader: Reads the visits that are kept.
        excerpt: The part of the log.
        scene: What is shown of it.
        chosen: Requested doors; None: those with most visits.
    """
    problems: list[str] = []
    by_door: defaultdict[DoorId, list[KeptVisit]] = defaultdict(list)
    for kept in _kept(reader, excerpt, chosen, problems):
        door = scene.doors.get(kept.visit.door_id)
        if door is not None and not kept.visit.passed and _is_here(kept, door, scene):
            by_door[door.door_id].append(kept)
    if not by_door and not problems:
        return None
    counts = Counter({door_id: len(visits) for door_id, visits in by_door.items()})
    order = [door_id for door_id in chosen or () if door_id in counts]
    order += [door_id for door_id, _ in counts.most_common() if door_id not in order]
    drawn = tuple(order[:MOST_DOORS])
    shown: set[tuple[DoorId, int]] = set()
    for door_id in drawn:
        visits = [kept.visit for kept in by_door[door_id]]
        shown |= {
            (door_id, visits[n].last_ns) for n in visit_words.worth_a_look(visits, MOST_VISITS)
        }
    return SightingsShown(
        doors=drawn,
        visits=frozenset(shown),
        lines={door_id: by_door[door_id][-1].line for door_id in drawn},
        left_out=counts.total() - len(shown),
        problems=tuple(problems),
        read_visits=reader,
    )


def sighting_path(door: SceneDoor) -> EntityPath:
    """Return the entity of a door's sightings, on the level where it was put last."""
    return (*door.path[:-2], SIGHTINGS, door.path[-1])


def write_sightings(
    writer: RowWriter, shown: SightingsShown, excerpt: Excerpt, scene: Scene, palette: Palette
) -> None:
    """Write the visits, door by door some at once."""
    pens = {door_id: _DoorPen(writer, scene.doors[door_id], excerpt.log.info.timezone, palette)
            for door_id in shown.doors}  # fmt: skip
    for kept in shown.read_visits(
        excerpt.log.path, excerpt.log.info.log_id,
        since_ns=excerpt.since_ns, until_ns=excerpt.until_ns,
        doors=shown.doors, with_scans=shown.has,
    ):  # fmt: skip
        door = scene.doors[kept.visit.door_id]
        if shown.has(kept.visit) and not kept.visit.passed and _is_here(kept, door, scene):
            pens[door.door_id].take(kept)
    for pen in pens.values():
        pen.finish()


def _kept(
    reader: VisitReader,
    excerpt: Excerpt,
    chosen: Collection[DoorId] | None,
    problems: list[str],
) -> Iterator[KeptVisit]:
    return reader(
        excerpt.log.path, excerpt.log.info.log_id,
        since_ns=excerpt.since_ns, until_ns=excerpt.until_ns,
        doors=chosen, with_scans=lambda _: False, tell=problems.append,
    )  # fmt: skip


def _is_here(kept: KeptVisit, door: SceneDoor, scene: Scene) -> bool:
    """Return whether the door was then on the level where its view is."""
    level = kept.level or scene.home_of_0 or 0
    return door.lines.get(level) == door.path


@dataclass(slots=True)
class _DoorPen:
    """Draws the visits of one door."""

    writer: RowWriter
    door: SceneDoor
    tz: str
    palette: Palette
    _waiting: list[KeptVisit] = field(default_factory=list)
    _has_begun: bool = False

    def take(self, kept: KeptVisit) -> None:
        self._waiting.append(kept)
        if len(self._waiting) >= AT_ONCE:
            self.finish()

    def finish(self) -> None:
        """Write what waits."""
        if not self._waiting:
            return
        if not self._has_begun:
            self._write_style()
            self._has_begun = True
        visits, self._waiting = self._waiting, []
        scenes = [visit_words.door_scene(kept) for kept in visits]
        pairs = list(zip(visits, scenes, strict=True))
        rows = np.zeros(len(visits), ROW)
        rows["folds_ns"] = [kept.visit.last_ns for kept in visits]
        colours = rgba([self.palette.of_state(kept.visit.state) for kept in visits])
        self._strips(rows, "beams", [_beams(scene, kept.line) for kept, scene in pairs])
        self._strips(rows, "track", [[visit_words.on_the_map(s.track, k.line)] for k, s in pairs])
        self._strips(rows, "line", [[_line(kept.line)] for kept in visits])
        leaves = [
            list(visit_words.on_the_map(s.leaves, k.line).reshape(-1, 2, 2)) for k, s in pairs
        ]
        self._strips(rows, "leaf", leaves, colours)
        self._points(rows, pairs)
        self._verdicts(rows, visits, colours)

    def _entity(self, part: str) -> EntityPath:
        return (*sighting_path(self.door), part)

    def _write_style(self) -> None:
        looks: dict[str, tuple[Rgb, int, float, float]] = {
            "beams": (self.palette.plain_text, 0x48, 0.5, 20.0),
            "track": (self.palette.robot, 0xFF, 1.5, 24.0),
            "line": (self.palette.label, 0xFF, 0.8, 24.5),
        }
        for part, (colour, alpha, radius, order) in looks.items():
            self.writer.static(
                self._entity(part),
                rr.LineStrips2D.from_fields(colors=rgba([colour], alpha), draw_order=order,
                                            radii=rr.Radius.ui_points(radius)),
            )  # fmt: skip
        self.writer.static(
            self._entity("leaf"),
            rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(3.5), draw_order=27.0),
        )
        self.writer.static(
            self._entity("points"),
            rr.Points2D.from_fields(draw_order=25.0),
        )
        self.writer.static(
            self._entity("verdict"),
            rr.Points2D.from_fields(radii=rr.Radius.ui_points(0.0), draw_order=30.0,
                                    show_labels=True),
        )  # fmt: skip

    def _strips(
        self, rows: Any, part: str, strips: Sequence[Sequence[visit_words.Points]],
        colours: NDArray[np.uint32] | None = None,
    ) -> None:  # fmt: skip
        """Write strips of each visit, or an empty set for a visit with none."""
        counts = np.array([len(of_visit) for of_visit in strips], np.uint32)
        flat = [strip.astype(np.float32) for of_visit in strips for strip in of_visit]
        of_each = None if colours is None else np.repeat(colours, counts)

        def columns(_: Any) -> Sequence[Any]:
            if not flat:
                return list(rr.Clear.columns(is_recursive=[False] * len(rows)))
            told = {} if of_each is None else {"colors": of_each}
            return list(rr.LineStrips2D.columns(strips=flat, **told).partition(counts))

        self.writer.rows(self._entity(part), rows, columns, [HAPPENED])

    def _points(self, rows: Any, pairs: Sequence[tuple[KeptVisit, visit_words.DoorScene]]) -> None:
        """Write where beams ended, in the colours of their fates."""
        look = np.array([
            self.palette.plain_text, BEAM_SHORT, self.palette.closed, self.palette.open,
            self.palette.plain_text,
        ])  # fmt: skip
        found = [_ends(scene) for _, scene in pairs]
        counts = np.array([len(ends) for ends, _ in found], np.uint32)
        ends = [
            visit_words.on_the_map(e, k.line) for (e, _), (k, _) in zip(found, pairs, strict=True)
        ]
        positions = np.concatenate(ends).astype(np.float32)
        fates = np.concatenate([fates for _, fates in found])
        colours = rgba([tuple(colour) for colour in look.tolist()])[fates]
        radii = rr.Radius.ui_points(
            np.where(fates == visit_words.Fate.aside, ASIDE_POINTS, TOLD_POINTS)
        )

        def columns(_: Any) -> Sequence[Any]:
            told = rr.Points2D.columns(positions=positions, colors=colours, radii=radii)
            return list(told.partition(counts))

        self.writer.rows(self._entity("points"), rows, columns, [HAPPENED])

    def _verdicts(
        self, rows: Any, visits: Sequence[KeptVisit], colours: NDArray[np.uint32]
    ) -> None:
        places = [_above(kept.line) for kept in visits]
        words = [self._words(kept.visit) for kept in visits]

        def columns(_: Any) -> Sequence[Any]:
            return list(rr.Points2D.columns(positions=places, labels=words, colors=colours))

        self.writer.rows(self._entity("verdict"), rows, columns, [HAPPENED])

    def _words(self, visit: Visit) -> str:
        lines = (
            visit_words.verdict(visit),
            visit_words.when(visit, self.tz),
            visit_words.grounds(visit),
        )
        return "\n".join(drawable(line) for line in lines)


def _beams(scene: visit_words.DoorScene, line: DoorLine) -> Sequence[visit_words.Points]:
    toward = scene.beams.toward()
    some = np.linspace(0, len(toward.ends) - 1, min(len(toward.ends), MOST_BEAMS)).astype(int)
    begins, ends = (
        visit_words.on_the_map(toward.begins[some], line),
        visit_words.on_the_map(toward.ends[some], line),
    )
    return list(np.stack([begins, ends], axis=1))


def _ends(scene: visit_words.DoorScene) -> tuple[visit_words.Points, NDArray[np.uint8]]:
    """Return where beams ended around the door, and their fates; lost ones ended nowhere."""
    beams, middle = scene.beams, np.array([scene.width / 2, 0.0])
    reach = scene.width / 2 + AROUND_M
    near = (np.abs(beams.ends - middle) <= reach).all(axis=1) & (
        beams.fates != visit_words.Fate.lost
    )
    places = np.flatnonzero(near)
    some = np.linspace(0, len(places) - 1, min(len(places), MOST_POINTS)).astype(int)
    chosen = places[some]
    return beams.ends[chosen], beams.fates[chosen]


def _line(line: DoorLine) -> visit_words.Points:
    return visit_words.on_the_map(np.array([[0.0, 0.0], [line[3], 0.0]]), line)


def _above(line: DoorLine) -> tuple[float, float]:
    """Return where the words stand: at the upper edge of the view."""
    x, y = visit_words.on_the_map(np.array([[line[3] / 2, 0.0]]), line)[0]
    return float(x), float(y) + line[3] / 2 + AROUND_M
