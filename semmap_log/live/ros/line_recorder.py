"""Events as JSON lines from a pipe, a file or a keyboard, each appended as one commit.

Lines that are waiting already share one sync; robot poses join the commit of the next line, or
are written after a second. Lines are answered once they are stored as the log's durability
promises. A line that cannot be stored is refused, whatever is wrong with it, and the others are
stored. Whatever ends the run, what was read before is written.
"""

from __future__ import annotations

import json
import os
import select
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from semmap_log import errors
from semmap_log.core.model.commits import NO_CONTENT, POSES_WAIT_S, Commit, Durability, content_of
from semmap_log.core.model.events import Retracted, RobotPose
from semmap_log.core.texts import brief
from semmap_log.interop.formats.json import event_json_reader
from semmap_log.interop.formats.json.door_json import means_same
from semmap_log.interop.formats.parsing.foreign_file import FileOrder
from semmap_log.interop.formats.parsing.strict_json import load_object
from semmap_log.log import Appended, DoorLogWriter

READ_BYTES = 2**16
MAX_LINE_BYTES = 2**23
POLL_S = 0.2
"""How soon a request to stop is noticed while nothing comes in."""


@dataclass(frozen=True, slots=True)
class LineAnswer:
    """What became of a line."""

    line: int
    """1-based."""
    event: int | None = None
    """Its event's number; None: refused."""
    error: str = ""


@dataclass(slots=True)
class LineRecorder:
    """Records the lines of a file descriptor until its end, or until it is stopped."""

    log: DoorLogWriter
    answer: Callable[[LineAnswer], None]
    """Called for every line, as soon as it is as durable as promised, or refused."""
    strict: bool = False
    """Stop at the first bad line."""
    recorded: int = 0
    refused: int = 0
    stopping: bool = False
    """Set by a signal handler: finish what was read, then return."""
    order: FileOrder = field(init=False)
    """The times of the lines."""
    _read: deque[bytes] = field(default_factory=deque)
    """Lines that were read, and not recorded yet."""
    _waiting: list[LineAnswer] = field(default_factory=list)
    _poses: list[tuple[int, RobotPose]] = field(default_factory=list)
    _poses_since: float = 0.0
    _waiting_since: float = 0.0
    _line: int = 0

    def __post_init__(self) -> None:
        self.order = FileOrder(self.log.info.timezone)

    def run(self, fd: int) -> None:
        """Record all lines of `fd`; on return everything is durable and answered.

        Raises:
            LogPoisonedError: A write failed; lines without an answer may or may not be stored.
            FormatError: `fd` cannot be read on; what was read before is stored.
        """
        try:
            for lines in _line_groups(fd, self._stop_or_wait, self._patience_s):
                self._read.extend(lines)
                if not self._take_all():
                    return
                if not self._may_wait():
                    self._settle()
        finally:  # whatever it was that ended it
            self._take_all()
            self._write_poses()
            self._settle()

    def _take_all(self) -> bool:
        """Record the lines that were read; return False if the run must end here."""
        while self._read:
            self._line += 1
            text = self._read.popleft()
            if text.strip() and not self._take(text):
                self._read.clear()
                return False
        return True

    def _stop_or_wait(self) -> bool:
        """Return whether to stop; called while nothing comes in, and between reads."""
        if self._poses and time.monotonic() - self._poses_since >= POSES_WAIT_S:
            self._write_poses()
        if self._waiting and not self._may_wait():
            self._settle()
        return self.stopping

    def _patience_s(self) -> float:
        """Return how long nothing need be done while nothing comes in."""
        return min(POLL_S, self.log.policy.batch_s) if self._waiting else POLL_S

    def _may_wait(self) -> bool:
        """Return whether lines that are written may wait for more to share their sync: `batch`."""
        policy = self.log.policy
        return (
            policy.level is Durability.BATCH
            and len(self._waiting) < policy.batch_events
            and time.monotonic() - self._waiting_since < policy.batch_s
        )

    def _take(self, text: bytes) -> bool:
        """Record a line, or refuse it; return False if the run must end here."""
        try:
            if not self._is_answered(text):
                parsed = self._parse(text)
                if isinstance(parsed.event, RobotPose) and parsed.own_command_id is None:
                    self._keep_pose(parsed.event)
                else:
                    self._append(parsed, text)
        except errors.LogPoisonedError:  # nothing more can be written
            raise
        except Exception as error:  # noqa: BLE001  the lines after it are stored, whatever it is
            self._wait(LineAnswer(self._line, error=_reason(error)))
            return not self.strict
        return True

    def _is_answered(self, text: bytes) -> bool:
        """Return whether the line is a command that is stored already, and answer it then.

        Its door may be gone by now, or its name mean another: so it is looked up before it is
        understood.
        """
        if len(text) > MAX_LINE_BYTES:
            raise errors.CommandError(
                f"expected at most {MAX_LINE_BYTES} bytes, got a longer line."
            )
        command_id = event_json_reader.command_id_of(text, path="line", line=self._line)
        stored = None if command_id is None else self.log.find_stored(command_id)
        if stored is None:
            return False
        known = stored.commit
        if not stored.has_content(_content(text)) and not self._holds(known, text):
            raise errors.CommandReusedError(
                f"command_id: stored already, as event {known.first_event}, for another line; "
                "give a new line a new id."
            )
        self._wait(LineAnswer(self._line, known.last_event))
        return True

    def _holds(self, known: Commit, text: bytes) -> bool:
        """Return whether a commit has the event of a line that a log wrote: `import` stored it."""
        parsed = self._parse(text)
        return parsed.is_exported and means_same(
            parsed.event, self.log.event(known.last_event).event
        )

    def _parse(self, text: bytes) -> event_json_reader.ParsedLine:
        lookup = event_json_reader.DoorLookup(
            resolve=self.log.resolve,
            next_id=lambda: self.log.door_index.next_free_id,
            level_of=self.log.level_of,
            level=self.log.level_meant,
        )
        parsed = event_json_reader.parse_event_line(
            text, lookup=lookup, order=self.order, path="line", line=self._line
        )
        if isinstance(parsed.event, Retracted) and parsed.number is not None:
            raise errors.CommandError(
                "this retraction was exported: its numbers are those of another log; `import` "
                "finds what they are here, and without its `event` they mean this log's."
            )
        if parsed.retracted:
            raise errors.CommandError(
                "this event was taken back in the log that wrote the line; `import` keeps both, "
                "the event and its retraction."
            )
        return parsed

    def _keep_pose(self, pose: RobotPose) -> None:
        if not self._poses:
            self._poses_since = time.monotonic()
        if pose.happened_ns is None:
            pose = replace(pose, happened_ns=self.log.now_ns())
        self._poses.append((self._line, pose))

    def _append(self, parsed: event_json_reader.ParsedLine, text: bytes) -> None:
        events = [*(pose for _, pose in self._poses), parsed.event]
        command_id = parsed.own_command_id
        content = _content(text) if command_id else NO_CONTENT
        appended = self.log.append(
            events, note=parsed.note, command_id=command_id, content=content, sync=False
        )
        self._answer_later(appended, [*(line for line, _ in self._poses), self._line])

    def _write_poses(self) -> None:
        if self._poses:
            appended = self.log.append([pose for _, pose in self._poses], sync=False)
            self._answer_later(appended, [line for line, _ in self._poses])

    def _answer_later(self, appended: Appended, lines: list[int]) -> None:
        first = appended.commit.last_event - len(lines) + 1
        for i, line in enumerate(lines):
            self._wait(LineAnswer(line, first + i))
        self._poses = []

    def _wait(self, answer: LineAnswer) -> None:
        """Keep an answer until what it speaks of is stored as was promised."""
        if not self._waiting:
            self._waiting_since = time.monotonic()
        self._waiting.append(answer)

    def _settle(self) -> None:
        """Sync once for all lines that wait, if that was promised, then answer them."""
        if self._waiting:
            if self.log.policy.level in (Durability.EVENT, Durability.BATCH):
                self.log.sync()
            answers, self._waiting = self._waiting, []
            self.refused += sum(bool(answer.error) for answer in answers)
            self.recorded += sum(not answer.error for answer in answers)
            for answer in answers:
                self.answer(answer)


def _line_groups(
    fd: int, stop: Callable[[], bool], patience_s: Callable[[], float]
) -> Iterator[list[bytes]]:
    """Yield the lines that wait on `fd`, a group at a time, until its end or until stopped."""
    rest = bytearray()
    while not stop():
        ready, _, _ = select.select([fd], [], [], patience_s())
        if not ready:
            continue
        data = _read_some(fd)
        if not data:
            break
        *lines, begun = data.split(b"\n")
        if lines:
            lines[0] = bytes(rest + lines[0])
            rest.clear()
            yield lines
        if len(rest) <= MAX_LINE_BYTES:  # else it is too long already, and refused at its end
            rest += begun
    else:
        return  # stopped: an unfinished line is not a line
    if rest:
        yield [bytes(rest)]


def _read_some(fd: int) -> bytes:
    """Return what waits on `fd`; nothing: its end."""
    try:
        return os.read(fd, READ_BYTES)
    except OSError as error:  # a folder, a disk that fails, a terminal that has gone
        raise errors.FormatError("standard input", f"cannot be read on: {error.strerror}") from None


def _content(text: bytes) -> bytes:
    """Return the digest of what a line says, however it is spaced and ordered."""
    return content_of("line", json.dumps(load_object(text), sort_keys=True))


def _reason(error: Exception) -> str:
    """Return why a line was refused, without the `line:7:` that the answer says already."""
    text = (
        str(error) if isinstance(error, errors.SemmapError) else f"{type(error).__name__}: {error}"
    )
    place, colon, rest = text.partition(": ")
    return brief(rest if colon and place.startswith("line:") else text)
