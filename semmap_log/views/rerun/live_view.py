"""Show a log in a viewer while another process writes to it: first its history, then new commits.

A commit that fits into what is shown (a sighting, a pose, a belief) becomes some more rows. One
that changes what had been written already (it is late, retracts something, adds, names, moves or
removes a door) cannot be taken out of a viewer: the history is written again, as another recording,
which replaces the first. So the viewer always shows what `save_rrd` would write.

The viewer may also run in a browser of this machine: a page, and the port its recordings come from.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any, Literal
from urllib.parse import urlencode

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.progress import Progress
from semmap_log.core.model import events
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.meaning import Changed, Presence
from semmap_log.core.model.moments import Time
from semmap_log.errors import ViewerError
from semmap_log.log import DoorLog, FollowedCommit
from semmap_log.views.bounds import Bounds
from semmap_log.views.excerpt.span import NO_PLANS, Excerpt
from semmap_log.views.palette import DEFAULT, Palette
from semmap_log.views.rerun.belief_curves import BeliefsShown, beliefs_to_show, round_lanes
from semmap_log.views.rerun.contents import RecordingContents
from semmap_log.views.rerun.file import Converter, open_recording
from semmap_log.views.rerun.process import LOCAL, RerunProcess, reserved_port, running
from semmap_log.views.rerun.recording import layout
from semmap_log.views.rerun.scene import Scene, SceneDoor, SceneLevel

POLL_S = 0.1
SEND_S = 60.0
"""Data that has not arrived by then will not: the viewer has gone, or is stuck."""


@dataclass(frozen=True, slots=True)
class LiveViewOptions:
    """Which part of a log is shown, and how."""

    since: Time = None
    """From then on; None: from the log's start."""
    doors: Collection[DoorId] | None = None
    """Only these; None: all."""
    palette: Palette = DEFAULT
    costmap: bool = True
    """With the costmap's door layer."""
    beliefs: bool = True
    """With the beliefs at the start of following."""


def follow_in_viewer(
    log: DoorLog,
    url: str,
    shown: LiveViewOptions = LiveViewOptions(),
    *,
    stop: Callable[[], bool],
    forget: Callable[[str], None] | None = None,
    progress: Progress | None = None,
) -> None:
    """Send a log to a viewer, then each commit as it comes, until `stop` returns true.

    Args:
        log: The log; it is refreshed.
        url: The viewer's address.
        shown: Which part of it, and how.
        stop: Called some ten times a second; true ends the view.
        forget: Called with the id of a recording that another one has replaced.
        progress: Called with the progress of the first reading.

    Raises:
        CorruptLogError: The log is damaged, or was exchanged for another state of itself.
        LogError: Another log lies there now.
        ViewerError: The viewer takes nothing more.
    """
    source = _Source(Excerpt.of(log, shown.since, None, shown.doors), shown)
    replaced: str | None = None
    for turn in count():
        log.refresh()
        contents = _contents(source.excerpt)
        scene = contents.scene() if turn == 0 else with_room(contents.scene())
        source.learn(scene)
        recording_id = log.info.log_id if turn == 0 else f"{log.info.log_id}-{turn}"
        with open_recording(recording_id) as recording:
            tail = _Tail(source, contents, scene, recording)
            tail.begin(url, progress if turn == 0 else None)
            if replaced is not None and forget is not None:
                forget(replaced)
            tail.proceed(stop)
        if not tail.is_outdated:
            return
        replaced = recording_id


@dataclass(slots=True)
class _Source:
    """What all recordings of one live view show."""

    excerpt: Excerpt
    shown: LiveViewOptions
    beliefs: BeliefsShown | None = None
    has_learnt: bool = False

    def learn(self, scene: Scene) -> None:
        """Compute the beliefs: once, since it takes seconds."""
        if self.shown.beliefs and not self.has_learnt:
            self.beliefs = beliefs_to_show(self.excerpt, scene, self.shown.doors)
        self.has_learnt = True

    def beliefs_in(self, scene: Scene) -> BeliefsShown | None:
        """Return the beliefs about doors that are still there to be shown."""
        if self.beliefs is None:
            return None
        return BeliefsShown(
            {door: points for door, points in self.beliefs.curves.items() if door in scene.doors},
            [week for week in self.beliefs.weeks if week.door.door_id in scene.doors],
        )


class _Tail:
    """One recording that goes on, as long as what comes fits into it."""

    def __init__(
        self, source: _Source, contents: RecordingContents, scene: Scene, recording: Any
    ) -> None:
        self.is_outdated = False
        """A commit came that does not fit."""
        self._source, self._contents, self._scene = source, contents, scene
        self._recording = recording
        self._commits = _Commits(source.excerpt.log.commits())
        self._waiting: list[FollowedCommit] = []

    def begin(self, url: str, progress: Progress | None) -> None:
        """Send the history."""
        shown, excerpt = self._source.shown, self._source.excerpt
        beliefs = self._source.beliefs_in(self._scene)
        rounds = round_lanes(excerpt, self._scene)
        blueprint = layout(
            self._scene, shown.palette,
            chosen=None if shown.doors is None else list(shown.doors),
            level=self._scene.robot_level, costmap=shown.costmap, beliefs=beliefs, goes_on=True,
            rounds=rounds, tz=excerpt.log.info.timezone,
        )  # fmt: skip
        self._recording.connect_grpc(url)
        self._recording.send_blueprint(blueprint)
        self._converter = Converter(
            self._recording, excerpt, self._scene, self._commits, palette=shown.palette,
            costmap=shown.costmap, beliefs=beliefs, rounds=rounds,
        )  # fmt: skip
        for batch in excerpt.batches(progress):
            self._converter.take(batch)
        self._converter.finish()
        _deliver(self._recording)

    def proceed(self, stop: Callable[[], bool]) -> None:
        """Send each new commit, until `stop` returns true or a commit does not fit."""
        log = self._source.excerpt.log
        for followed in log.follow(poll_s=POLL_S, stop=lambda: stop() or self._is_over()):
            self._waiting.append(followed)

    def _is_over(self) -> bool:
        """Send what came since the last poll; return whether some of it does not fit."""
        commits, self._waiting = self._waiting, []
        if commits and not self.is_outdated:
            self.is_outdated = not self._send(commits)
        return self.is_outdated

    def _send(self, commits: Sequence[FollowedCommit]) -> bool:
        """Send the commits, if all of them fit; return whether they do."""
        batches = [
            part for each in commits if len(part := self._source.excerpt.part_of(each.batch))
        ]
        if not all(fits(batch, self._contents, self._scene) for batch in batches):
            return False
        self._commits.coming.extend(each.commit for each in commits)
        for batch in batches:
            self._converter.take(batch)
        self._converter.flush()
        _deliver(self._recording)
        return True


@dataclass(slots=True)
class _Commits:
    """The commits of a log, followed by new ones as they come."""

    known: Iterator[Commit]
    coming: deque[Commit] = field(default_factory=deque)

    def __iter__(self) -> Iterator[Commit]:
        yield from self.known
        while True:  # who asks has an event at hand, whose commit has come, too
            yield self.coming.popleft()


def _deliver(recording: Any) -> None:
    """Wait until all that was written is in the viewer.

    Raises:
        ViewerError: It does not take it.
    """
    try:
        recording.flush(timeout_sec=SEND_S)
    except (RuntimeError, TimeoutError) as error:
        raise ViewerError(f"The rerun viewer takes nothing more: {error}.") from None


def _contents(excerpt: Excerpt) -> RecordingContents:
    contents = RecordingContents(excerpt)
    for batch in excerpt.read():
        contents.take(batch)
    return contents


START_S = 60.0
MEMORY_LIMIT = "75%"
"""Of all: what is beyond is dropped, the oldest first, which would be the history."""

Theme = Literal["light", "dark"]


@dataclass(frozen=True, slots=True)
class WebViewer:
    """A web server of rerun's, and its addresses."""

    program: RerunProcess
    page_port: int

    @property
    def url(self) -> str:
        """Where recordings are sent to, and where other viewers get them."""
        return self.program.url

    def page(self, theme: Theme | None = None) -> str:
        """Return the address of the page to open; without a theme it has the browser's."""
        asked = {"url": self.url, "hide_welcome_screen": "1"}
        if theme is not None:
            asked["theme"] = theme
        return f"http://{LOCAL}:{self.page_port}/?{urlencode(asked)}"


@contextmanager
def web_viewer(source: Path | None = None) -> Iterator[WebViewer]:
    """Serve the viewer to browsers on this machine alone; it is gone when the block ends.

    Args:
        source: A recording to show; None: what will be sent to it.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no such recording, or rerun failed.
    """
    if source is not None and not source.is_file():
        raise ViewerError(f"{source}: there is no such recording.")
    shown = [] if source is None else [str(source)]
    with reserved_port() as port, running(_options(port) + shown, os.environ) as program:
        program.wait_for(
            "serve its page",
            lambda: program.is_listening(port) and program.is_listening(),
            most_s=START_S,
        )
        yield WebViewer(program, port)


def _options(port: int) -> list[str]:
    return ["--serve-web", "--web-viewer-port", str(port), "--server-memory-limit", MEMORY_LIMIT]


NEVER_FIT = (
    events.Retracted,
    events.LevelAdded,
    events.FloorMap,
    events.PatrolStarted,
    events.PatrolFinished,
)
MAY_CHANGE_THE_SCENE: tuple[type[events.Event], ...] = (
    events.DoorAnnotated,
    *(
        kind
        for kind in events.SETTING_KINDS
        if kind.effect.presence is not Presence.STAYS or kind.effect.can_set & ~Changed.STATE
    ),
)

ROOM = 0.25
"""Added on each side of a plan that was outgrown, as a share of its longer side: a robot that
explores should not outgrow it again at once."""


def fits(batch: EventBatch, contents: RecordingContents, scene: Scene) -> bool:
    """Return whether the next events fit a scene as more rows; the contents take them in.

    Args:
        batch: The next events.
        contents: The contents of all earlier events.
        scene: What is shown of these.
    """
    if any(kind in batch for kind in NEVER_FIT) or contents.is_late(batch):
        return False
    contents.take(batch)
    if any(kind in batch for kind in MAY_CHANGE_THE_SCENE):
        return _look(scene) == _look(contents.scene()) and _is_inside(contents.scene(), scene)
    return events.RobotPose not in batch or _is_robot_inside(batch, scene)


def with_room(scene: Scene) -> Scene:
    """Return the scene with room around plans whose extent no wall limits."""
    levels = {
        n: level if level.floor is not None else replace(level, bounds=_grown(level.bounds))
        for n, level in scene.levels.items()
    }
    return replace(scene, levels=levels)


def _look(scene: Scene) -> tuple[list[SceneDoor], list[SceneLevel], int | None]:
    """Return all of a scene that is drawn once, without counts and extents."""
    doors = [replace(door, state_changes=0) for door in scene.doors.values()]
    levels = [
        replace(level, floor=None, plans=NO_PLANS, bounds=Bounds())
        for level in scene.levels.values()
    ]
    return doors, levels, scene.home_of_0


def _is_inside(inner: Scene, outer: Scene) -> bool:
    return all(
        outer.levels[n].bounds.holds(level.bounds.without_margin())
        for n, level in inner.levels.items()
    )


def _is_robot_inside(batch: EventBatch, scene: Scene) -> bool:
    poses = batch[events.RobotPose]
    for n in np.unique(poses["level"]).tolist():
        shown = scene.home_of_0 if n == 0 else n
        if shown is None:
            continue
        level = scene.levels.get(shown)
        here = poses[poses["level"] == n]
        if level is None or not level.has_robot:
            return False
        if not level.bounds.holds(Bounds().around(here["x"], here["y"])):
            return False
    return True


def _grown(bounds: Bounds) -> Bounds:
    more = ROOM * bounds.longest_side_m
    return Bounds(
        bounds.low_x - more, bounds.low_y - more, bounds.high_x + more, bounds.high_y + more
    )
