"""The log as it would be had nothing been taken out: a plain list of events, folded by hand.

It shares no code with the log that it judges. What was taken out it knows as well: so it can tell
which questions may be refused, and which must be answered.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from fault_injection.oracle.doors import OPEN, STATE, doors, stamp

HOUR_NS = 3600 * 10**9
EXPIRING = {"DoorUpdated", "DoorObserved", "DoorRequested", "DoorPassed", "RobotPose",
            "SightingsThinned"}  # fmt: skip
"""Kinds that go once they are older than a log is kept."""
OF_THE_LOG = {"HistoryTrimmed", "MomentPinned"}
"""Kinds that no range hides, only their own number."""
OF_TRIMMING = {"HistoryTrimmed", "SightingsThinned"}
"""Kinds that only say what was taken out."""

Row = dict[str, Any]
"""An event: `event` (its number), `kind`, `happened`, `recorded`, and its own fields."""


@dataclass
class Commit:
    """Events that were stored together."""

    recorded_ns: int
    closed_ns: int
    """Log time of its last record."""
    command_id: bytes
    note: tuple[str, str, str, str]
    events: list[Row]
    numbers: list[int] = field(init=False)
    """Of all its events, also of those that went."""

    def __post_init__(self) -> None:
        self.numbers = [row["event"] for row in self.events]

    @property
    def first(self) -> int:
        """Number of its first event."""
        return self.numbers[0]

    @property
    def last(self) -> int:
        """Number of its last event."""
        return self.numbers[-1]


@dataclass
class WholeLog:
    """All that was ever stored, and what became of it."""

    commits: list[Commit] = field(default_factory=list)
    rows: dict[int, Row] = field(default_factory=dict)
    """By number; those whose words were redacted are not among them."""
    gone: dict[int, str] = field(default_factory=dict)
    """Number of an event that the log does not hold any more -> why."""
    from_trimming: set[int] = field(default_factory=set)
    """Numbers of events that say what was taken out: there would be none of them."""
    horizon: int = 0
    """Events below this number cannot be asked about."""

    def take(self, commit: Commit) -> None:
        """Take in what was stored."""
        self.commits.append(commit)
        self.rows |= {row["event"]: row for row in commit.events}

    @property
    def last(self) -> int:
        """Number of the last event; -1: there is none."""
        return self.commits[-1].last if self.commits else -1

    def commit_of(self, number: int) -> Commit:
        """Return the commit with that event."""
        return next(one for one in reversed(self.commits) if one.first <= number)

    def known_at(self, known_at: int) -> int:
        """Return the number of the last event that was known then; -1: none was."""
        return max((c.last for c in self.commits if c.recorded_ns <= known_at), default=-1)

    @property
    def horizon_ns(self) -> int:
        """Log time of the last record before the horizon; -1: there is none."""
        return self.commit_of(self.horizon - 1).closed_ns if self.horizon else -1

    def forget_texts(self, door: int, key: str, before: int) -> None:
        """Leave out what was said of a door below a number, and pins: they may repeat it."""
        for number, row in list(self.rows.items()):
            if number >= before:
                continue
            if row["kind"] == "DoorAnnotated" and (row["door_id"], row["key"]) == (door, key):
                commit = self.commit_of(number)
                commit.events = [one for one in commit.events if one["event"] != number]
                del self.rows[number]
                self.gone[number] = "redacted"
            elif row["kind"] == "MomentPinned":
                self.gone[number] = "redacted"

    def forget_poses(self, before: int) -> None:
        """Leave out where the robot was, below a number."""
        for number, row in self.rows.items():
            if number < before and row["kind"] == "RobotPose":
                self.gone.setdefault(number, "redacted")

    def forget_notes(self, actor: str | None, before: int) -> None:
        """Leave out who sent commits below a number, and why.

        Args:
            actor: Whose commits; None: everybody's.
            before: The number.
        """
        for commit in self.commits:
            if commit.last < before and actor in {None, commit.note[0]}:
                commit.note = ("", "", "", "")

    # what is true

    def doors(self, **moment: int | None) -> dict[str, Any]:
        """Return the door map of a moment: `at`, `known_at`, `event`, some of them or none."""
        return doors(self, **moment)

    @property
    def has_retractions(self) -> bool:
        """Whether something was taken back."""
        return any(row["kind"] == "Retracted" for row in self.rows.values())

    def hidden(self) -> set[int]:
        """Return the numbers of all events that were taken back."""
        ranges = [(row["first_event"], row["last_event"]) for row in self.rows.values()
                  if row["kind"] == "Retracted"]  # fmt: skip
        return {
            number
            for first, last in ranges
            for number in range(first, last + 1)
            if number in self.rows and self.rows[number]["kind"] != "Retracted"
            and (first == last or self.rows[number]["kind"] not in OF_THE_LOG)
        }  # fmt: skip

    def visible(self) -> Iterator[Row]:
        """Yield the events that count."""
        hidden = self.hidden()
        return (row for number, row in sorted(self.rows.items()) if number not in hidden)

    def setting_states(self, before: int) -> set[int]:
        """Return the numbers of the events below a number that last set the state of a door."""
        last: dict[int, Row] = {}
        for row in self.visible():
            if row["event"] < before and self._state_set(row) is not None:
                last[row["door_id"]] = max(last.get(row["door_id"], row), row, key=stamp)
        return {row["event"] for row in last.values()}

    def pins(self) -> dict[str, int]:
        """Return the moments that have a name."""
        return {
            row["name"]: row["at_ns"] for row in self.visible() if row["kind"] == "MomentPinned"
        }

    def state(self, door: int, **moment: int | None) -> str | None:
        """Return the state of a door at a moment; None: it was not there."""
        found = (one["state"] for one in self.doors(**moment)["doors"] if one["door_id"] == door)
        return next(found, None)

    # what was taken out of it

    @property
    def thinned(self) -> list[Row]:
        """Sightings that went since they repeat others."""
        seen = (self.rows[number] for number, why in self.gone.items() if why == "thinned")
        return [row for row in seen if row["kind"] == "DoorObserved"]

    def repeated(self, before: int, *, surely: bool) -> set[int]:
        """Return the sightings below a number that repeat what stays: a thinning takes them out.

        Of those of a door that follow each other in one hour and say the same the first and the
        last stay, and what was known before all earlier ones. For a log in which nothing is taken
        back.

        Args:
            before: The number.
            surely: Only those that were known after the first: others go if the first lies outside
                the time of their file.
        """
        found = set()
        by_door: dict[int, list[Row]] = {}
        for row in self.rows.values():
            if self._state_set(row) is not None or row["kind"] == "DoorRemoved":
                by_door.setdefault(row["door_id"], []).append(row)
        for rows in by_door.values():
            for run in self._runs(sorted(rows, key=stamp)):
                for place, row in enumerate(run[1:-1], start=1):
                    known = min(one["event"] for one in run[: 1 if surely else place])
                    if row["kind"] == "DoorObserved" and known < row["event"] < before:
                        found.add(row["event"])
        return found

    def _runs(self, rows: list[Row]) -> Iterator[list[Row]]:
        """Yield the events of a door, in order, that follow each other and say the same."""
        run: list[Row] = []
        for row in rows:
            is_next = row["kind"] == "DoorAdded"
            if run and (is_next or self._run_of(row) != self._run_of(run[0])):
                yield run
                run = []
            run.append(row)
        if run:
            yield run

    def _run_of(self, row: Row) -> object:
        """Return what sightings have in common that repeat each other."""
        if row["kind"] == "DoorRemoved":
            return row["event"]
        return stamp(row)[0] // HOUR_NS, self._state_set(row)

    def may_refuse(self, *, at: int | None = None, known_at: int | None = None,
                   event: int | None = None) -> bool:  # fmt: skip
        """Tell whether a question is about what is gone for its age."""
        if event is not None and event + 1 < self.horizon:
            return True
        if known_at is not None and known_at < self.horizon_ns:
            return True
        if at is None or at >= self.horizon_ns:
            return False
        return at not in self.pins().values() or known_at is not None or event is not None

    @property
    def last_lost(self) -> int:
        """Number of the last event that went for its age or as repeated; -1: none did."""
        lost = (number for number, why in self.gone.items() if why != "redacted")
        return max(lost, default=-1)

    def may_refuse_event(self, row: Row) -> bool:
        """Tell whether an event sets a state that would have ended at a sighting that is gone."""
        state = self._state_set(row)
        when = stamp(row)[0]
        return state is not None and any(
            one["door_id"] == row["door_id"] and one["state"] != state
            and stamp(one)[0] > when and stamp(one)[0] // HOUR_NS == when // HOUR_NS
            for one in self.thinned
        )  # fmt: skip

    @staticmethod
    def _state_set(row: Row) -> int | None:
        if row["kind"] == "DoorPassed":
            return OPEN if row["passed"] else None
        if row["kind"] in {"DoorAdded", "DoorObserved"} or row.get("changed", 0) & STATE:
            return int(row["state"])
        return None
