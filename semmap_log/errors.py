"""Every error this package raises on purpose, as one tree.

    SemmapError                     catch this one to catch them all
    ├── InvalidEventError           an event holds a value that no door can have     (ValueError)
    ├── CommandError                the map as it stands forbids the command
    │   ├── UnknownDoorError        no such door                                     (LookupError)
    │   ├── DoorExistsError         the id is taken, with other values
    │   ├── DoorRemovedError        the id belonged to a door that is gone
    │   ├── UnknownLevelError       no such level                                    (LookupError)
    │   ├── CommandReusedError      the command id is stored, with other content
    │   └── UnexpectedEventError    the log went on since the caller looked
    ├── UnknownKeywordError         a call of the Python API does not know that keyword (TypeError)
    ├── MomentError                 a time that cannot be read, or that is ambiguous (ValueError)
    ├── LogError                    the log on disk
    │   ├── NotALogError            a file, an empty folder, somebody else's bag
    │   ├── LogExistsError          there is something already where a log should be made
    │   ├── LogLockedError          another process is writing
    │   ├── LogAccessError          the file system says no
    │   ├── ElsewhereError          its bytes were removed from this disk: they lie at a URL
    │   ├── LogPoisonedError        a write failed: the outcome of its events is unknown
    │   ├── NewerLogError           a later version of this program has written the answer's events
    │   └── CorruptLogError         damage, with file and offset
    │       └── UnreadableLogError  bytes that the disk refuses, or that were cut off meanwhile
    ├── FormatError                 a foreign file that cannot be read, with file and line
    ├── CostmapError                a grid that cannot be, or does not fit           (ValueError)
    ├── EstimatorError              an estimator that there is not, or that cannot say  (ValueError)
    ├── CheckpointError             a checkpoint of something else, or of an odd state
    ├── OutputError                 a file that could not be written; the old one is whole (OSError)
    ├── QuestionError               a planner's question that nobody understands       (ValueError)
    ├── AddressError                an address that cannot be taken, or where nobody is  (OSError)
    ├── EngineError                 an engine for many logs is not there, or has gone
    ├── SigningError                a key that cannot be used, or a log that must not be signed
    │   └── PassphraseError         the key is encrypted, and its passphrase missing or wrong
    ├── RosError                    ROS is not there, or lacks something that is needed
    └── MissingExtraError           an optional package is not installed             (ImportError)

and seven warnings:

    KeyframeWarning                 a cache in the log cannot be used; answers only take longer
    NewerLogWarning                 events of a later version are left out; they change no answer
    EarlyEventsWarning              what was appended had happened before its door was added
    FutureTimesWarning              what was appended happens in time to come, by the log's clock
    LevelNameWarning                a level's name is the number of another; the name counts
    KnownLaterWarning               nothing was known at a moment, but was recorded later
    SensorWarning                   what a sensor read contradicts the accuracies declared for it
    ClockTimeWarning                a time such as 14:02 could mean that of several days
    ClockWarning                    an answer reaches back to when the robot's clock was not set

Messages say where, what was expected, what was got and, where it helps, what to do.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PurePath

from semmap_log.core.texts import MOST_LISTED, Repeats


class SemmapError(Exception):
    """Base of every error of this package."""


class InvalidEventError(SemmapError, ValueError):
    """An event holds a value that no door can have."""

    def __init__(self, where: str, expected: str, got: object) -> None:
        super().__init__(f"{where}: expected {expected}, got {got!r}.")
        self.where = where
        self._said = (expected, got)

    def of_row(self, row: int) -> InvalidEventError:
        """Return the same of an event that is a row of columns."""
        return InvalidEventError(f"row {row}: {self.where}", *self._said)


class CommandError(SemmapError):
    """The map as it stands forbids the command."""


class UnknownDoorError(CommandError, LookupError):
    """No door of that id or name is in the map."""


class DoorExistsError(CommandError):
    """The id is taken by a door with other values."""


class DoorRemovedError(CommandError):
    """The id belonged to a door that was removed; ids are never used twice."""


class UnknownLevelError(CommandError, LookupError):
    """No level of that number or name is in the map."""


class CommandReusedError(CommandError):
    """A command id that is stored already was given for other events."""


class UnexpectedEventError(CommandError):
    """The last event, of the log or of a door, is not the one that the caller expected."""

    def __init__(self, of: str, expected: int, actual: int) -> None:
        super().__init__(
            f"expected event {expected} to be the last of {of}, got {actual}; "
            "look at what came in between, and decide again."
        )
        self.expected = expected
        self.actual = actual
        """Number of the last event; -1: there is none."""


class UnknownKeywordError(SemmapError, TypeError):
    """A call does not know that keyword; the message names those that it knows."""


class MomentError(SemmapError, ValueError):
    """A moment that cannot be read, or that names two instants."""


class LogError(SemmapError):
    """Something about the log on disk."""


class NotALogError(LogError):
    """There is no semmap log at that path."""


class LogExistsError(LogError):
    """There is something already where a new log should be made."""


class LogLockedError(LogError):
    """Another process holds the log open for writing."""


class LogAccessError(LogError, OSError):
    """The file system does not let us read or write the log."""


class ObjectChangedError(LogAccessError):
    """An object in a store is another than it was when it was first looked at."""


class ElsewhereError(LogError):
    """The bytes were shipped and removed from this disk; the message says where they are."""


class LogPoisonedError(LogError):
    """A write or sync failed; whether its events are stored is unknown until it is reopened."""

    def __init__(self, message: str, command_id: bytes = b"") -> None:
        super().__init__(message)
        self.command_id = command_id
        """Of the append that failed: the same events with this id, appended once the log is open
        again, are stored once. Empty where no append was under way."""


class HorizonError(LogError):
    """The question reaches back to events that were removed because of their age."""


class NewerLogError(LogError):
    """A later version of this program has written what would be needed for an answer.

    Nothing is damaged: a program of that version reads it.
    """


class CorruptLogError(LogError):
    """The bytes of a segment are not what was written."""

    def __init__(self, path: PurePath, offset: int | None, problem: str) -> None:
        at = "" if offset is None else f" at byte {offset}"
        super().__init__(f"{path}: damaged{at}: {problem}")
        self.problem = problem
        self.path = path
        self.offset = offset
        """None: it is the whole file, or the folder, that is not what it was."""


class StaleIndexError(LogError):
    """The tables of a segment are of something else, half, or damaged: they are not used."""


class UnreadableLogError(CorruptLogError):
    """Bytes of a segment that the disk refuses, or that are gone since the file was opened."""

    def __init__(self, path: PurePath, offset: int, problem: str) -> None:
        super().__init__(path, offset, problem)
        self.args = (f"{path}: cannot be read at byte {offset}: {problem}",)


class FormatError(SemmapError, ValueError):
    """A foreign file that cannot be read: every problem found, each with its line."""

    def __init__(
        self, path: Path | str, problems: str | Repeats | Iterable[tuple[int, str]]
    ) -> None:
        self.path = path
        self.repeats = Repeats()
        """The problems by kind; empty where it is one of the whole file."""
        if isinstance(problems, str):
            super().__init__(f"{path}: {problems}")
            return
        if isinstance(problems, Repeats):
            self.repeats = problems
        else:
            for line, text in problems:
                self.repeats.add(line, text)
        super().__init__("\n".join(self._lines()))

    @property
    def first(self) -> str:
        """The first problem, without file and line; empty where it is one of the whole file."""
        return next((kind.kept[0][1] for kind in self.repeats), "")

    def _lines(self) -> list[str]:
        """Return what is shown: all problems if they are few, else the first of each kind."""
        if self.repeats.count <= MOST_PROBLEMS_SHOWN:
            found = [problem for kind in self.repeats for problem in kind.kept]
            return self._placed(sorted(found, key=lambda problem: problem[0]))
        lines: list[str] = []
        told = 0
        for kind in self.repeats:
            if len(lines) >= MOST_PROBLEMS_SHOWN:
                break
            lines += [*self._placed(kind.kept[:MOST_LISTED]), *kind.rest()]
            told += kind.count
        if told < self.repeats.count:
            lines.append(f"… and {self.repeats.count - told:,} more problems in {self.path}")
        return lines

    def _placed(self, problems: list[tuple[int, str]]) -> list[str]:
        return [f"{self.path}:{line}: {text}" for line, text in problems]


class CostmapError(SemmapError, ValueError):
    """A grid that cannot be, or that does not fit the others of its costmap."""


class EstimatorError(SemmapError, ValueError):
    """There is no such estimator, it cannot answer the question, or it cannot be judged."""


class PlanError(SemmapError, ValueError):
    """A round or a way that cannot be planned: no way there, no stops, or no time."""


class CheckpointError(SemmapError):
    """A checkpoint is of something else, or cannot be read; or a state cannot be stored in one."""


class ViewerError(SemmapError):
    """The rerun viewer did not start, or failed at what it had to do."""


class OutputError(SemmapError, OSError):
    """A file could not be written; what had that name before is still whole."""


class SqlError(SemmapError, ValueError):
    """A query that is no question, or that names what is not there."""


class QuestionError(SemmapError, ValueError):
    """A planner's question that cannot be understood."""


class AddressError(SemmapError, OSError):
    """An address at which questions cannot be taken, or at which nobody answers them."""


class EngineError(SemmapError):
    """The engine that queries many logs is missing, has gone, or cannot answer this question."""


class SigningError(SemmapError):
    """A key or signature that cannot be used, or a log that is not what was signed before."""


class PassphraseError(SigningError):
    """The key is encrypted, and no passphrase was given, or a wrong one."""


class RosError(SemmapError):
    """ROS is not there, does not answer, or lacks something that is needed."""


class MissingExtraError(SemmapError, ImportError):
    """An optional package is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(
            f"{package} is not installed; install it with: pip install 'semmap-log[{extra}]'"
        )


MOST_PROBLEMS_SHOWN = 20
"""So that a wrong file of a million lines does not scroll the terminal away."""


class NewerLogWarning(UserWarning):
    """Events of kinds that a later version has added are left out: they change no answer."""


class HorizonWarning(UserWarning):
    """An answer rests on what is younger than the log's horizon: what was before is gone."""


class KeyframeWarning(UserWarning):
    """A keyframe cannot be used: it is of another version, or damaged. The answer is the same."""


class CheckpointWarning(UserWarning):
    """A checkpoint is not used, and the fold begins at the log's start."""


class EarlyEventsWarning(UserWarning):
    """Events had happened before their door was added: they are kept, and no answer counts them."""


class FutureTimesWarning(UserWarning):
    """Events claim to happen later than they were recorded: they count from that time on."""


class LevelNameWarning(UserWarning):
    """A text was taken for the level of that name, and is the number of another level."""


class KnownLaterWarning(UserWarning):
    """Nothing was known at that moment: what the log has about it was recorded later."""


class SensorWarning(UserWarning):
    """What a sensor read contradicts the accuracies that are declared for it: P(open) is off."""


class ClockTimeWarning(UserWarning):
    """A time such as 14:02 or Tue 10:00 could mean that of several days; one was taken."""


class ClockWarning(UserWarning):
    """Events happened at times at which the robot's clock cannot have been right."""
