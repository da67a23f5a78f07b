"""Events as JSON lines from a pipe, a file or a keyboard, each appended as one commit.

Lines that are waiting already share one sync; robot poses join the commit of the next line, or
are written after a second. Every line is answered once it is durable, or once it is refused.
"""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from semmap_log.appendable_log import POSES_WAIT_S, Appended
from semmap_log.commits import Note
from semmap_log.door_log_writer import DoorLogWriter
from semmap_log.errors import CommandError, FormatError, SemmapError
from semmap_log.events import Retracted, RobotPose
from semmap_log.formats.event_json_reader import DoorLookup, ParsedLine, parse_event_line

READ_BYTES = 2**16
MAX_LINE_BYTES = 2**23
POLL_S = 0.2
"""How soon a request to stop is noticed while nothing comes in."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of a line."""

    line: int
    """1-based."""
    event: int | None = None
    """Its event's number; None: refused."""
    error: str = ""


@dataclass(slots=True)
class LineRecorder:
    """Records the lines of a file descriptor until its end, or until it is told to stop."""

    log: DoorLogWriter
    answer: Callable[[Answer], None]
    """Told of every line: as soon as it is durable, or refused."""
    strict: bool = False
    """Stop at the first bad line."""
    recorded: int = 0
    refused: int = 0
    stopping: bool = False
    """Set by a signal handler: finish what was read, then return."""
    _waiting: list[Answer] = field(default_factory=list)
    _poses: list[tuple[int, RobotPose]] = field(default_factory=list)
    _poses_since: float = 0.0
    _line: int = 0

    def run(self, fd: int) -> None:
        """Record all lines of `fd`; on return everything is durable and answered.

        Raises:
            LogPoisonedError: A write failed; lines without an answer may or may not be stored.
        """
        for lines in _line_groups(fd, self._stop_or_wait):
            for text in lines:
                self._line += 1
                if text.strip() and not self._take(text):
                    self._finish()
                    return
            self._settle()
        self._finish()

    def _finish(self) -> None:
        self._write_poses()
        self._settle()

    def _stop_or_wait(self) -> bool:
        """Tell whether to stop; called while nothing comes in, and between reads."""
        if self._poses and time.monotonic() - self._poses_since >= POSES_WAIT_S:
            self._write_poses()
            self._settle()
        return self.stopping

    def _take(self, text: bytes) -> bool:
        """Record a line; return False if the run must end here."""
        try:
            parsed = self._parse(text)
            if isinstance(parsed.event, RobotPose):
                self._keep_pose(parsed.event)
            else:
                self._append(parsed)
        except (FormatError, CommandError) as error:
            self.refused += 1
            self.answer(Answer(self._line, error=_without_place(error)))
            return not self.strict
        return True

    def _parse(self, text: bytes) -> ParsedLine:
        if len(text) > MAX_LINE_BYTES:
            raise CommandError(f"longer than {MAX_LINE_BYTES} bytes.")
        lookup = DoorLookup(
            resolve=self.log.resolve,
            next_id=lambda: self.log.roster.next_free_id,
            level_of=self.log.level_of,
        )
        parsed = parse_event_line(
            text, tz=self.log.info.timezone, lookup=lookup, path="line", line=self._line
        )
        if isinstance(parsed.event, Retracted) and parsed.number is not None:
            raise CommandError(
                "this retraction was exported: its numbers are those of another log; "
                "without its `event` they mean this one's."
            )
        return parsed

    def _keep_pose(self, pose: RobotPose) -> None:
        if not self._poses:
            self._poses_since = time.monotonic()
        if pose.happened_ns is None:
            pose = replace(pose, happened_ns=self.log.now_ns())
        self._poses.append((self._line, pose))

    def _append(self, parsed: ParsedLine) -> None:
        note = Note(parsed.actor, parsed.source, parsed.reason, parsed.correlation)
        events = [*(pose for _, pose in self._poses), parsed.event]
        appended = self.log.append(events, note=note, command_id=parsed.command_id, sync=False)
        if appended.repeated:
            self._waiting.append(Answer(self._line, appended.commit.last_event))
            return
        self._answer_later(appended, [*(line for line, _ in self._poses), self._line])

    def _write_poses(self) -> None:
        if self._poses:
            appended = self.log.append([pose for _, pose in self._poses], sync=False)
            self._answer_later(appended, [line for line, _ in self._poses])

    def _answer_later(self, appended: Appended, lines: list[int]) -> None:
        first = appended.commit.last_event - len(lines) + 1
        self._waiting += [Answer(line, first + i) for i, line in enumerate(lines)]
        self._poses = []

    def _settle(self) -> None:
        """Sync once for all lines that wait, then answer them."""
        if self._waiting:
            self.log.sync()
            for answer in self._waiting:
                self.recorded += 1
                self.answer(answer)
            self._waiting = []


def _line_groups(fd: int, stop: Callable[[], bool]) -> Iterator[list[bytes]]:
    """Yield the lines that wait on `fd`, a group at a time, until its end or until told to stop."""
    rest = b""
    while not stop():
        ready, _, _ = select.select([fd], [], [], POLL_S)
        if not ready:
            continue
        data = os.read(fd, READ_BYTES)
        if not data:
            break
        *lines, rest = (rest + data).split(b"\n")
        rest = rest[: MAX_LINE_BYTES + 1]  # too long already: it is refused once its end is seen
        if lines:
            yield lines
    else:
        return  # told to stop: a line that has begun is not a line
    if rest:
        yield [rest]


def _without_place(error: SemmapError) -> str:
    """Return an error's text without the `line:7:` that the answer says already."""
    text = str(error)
    place, colon, rest = text.partition(": ")
    return rest if colon and place.startswith("line:") else text
