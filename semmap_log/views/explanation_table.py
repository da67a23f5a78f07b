"""Why a door was in a state, for people: a fact a row, in whole words, all on one screen."""

from __future__ import annotations

from collections.abc import Callable

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import format_local, format_short
from semmap_log.core.model.object_classes import DOOR, ObjectClass
from semmap_log.log.door_log.explanation import Explanation, StateReason
from semmap_log.views.belief_words import why_unknown
from semmap_log.views.column_table import CellValue
from semmap_log.views.event_words import printable, words_of
from semmap_log.views.pairs import PairTable, add_pair, pairs
from semmap_log.views.tables import (
    LATE_NS,
    OTHER_STATE_COLOUR,
    STATE_COLOURS,
    taken_back,
    values_before,
)
from semmap_log.views.timeline_table import duration

MOST_OTHERWISE = 5
"""So many events that say otherwise are shown, those nearest to the moment; `--json` has all."""
LIKELY = 0.5
OTHERS = "other reports"
UNIT_WORDS = {"d": "day", "h": "hour", "min": "minute", "s": "second"}

When = Callable[[int], str]
"""How a time is written."""


def explanation_table(told: Explanation, *, tz: str) -> RenderableType:
    """Return what a log tells of a door at a moment.

    Args:
        told: The answer.
        tz: IANA zone of the times.
    """
    rows = _Rows(told, tz)
    rows.add("door", lambda _: Text(_called(told)))
    rows.add("moment", lambda _: Text(format_local(told.time_ns, tz)))
    rows.add_state("true", told.true)
    if told.known_event is not None:
        _add_believed(rows, told)
    _add_otherwise(rows, told)
    rows.add("P(open)", lambda _: _p_open(told))
    rows.add("next change", lambda when: _next(told, when))
    return Group(rows.table, Text(_caption(told, rows), style="dim"))


class _Rows:
    """Names and values; times are drawn short, and told to programs in full."""

    def __init__(self, told: Explanation, tz: str) -> None:
        self.table: PairTable = pairs()
        self._told = told
        self._tz = tz
        self._of = _class_told(told)
        self._day = format_short(told.time_ns, tz).partition(" ")[0]

    def add(self, name: str, value: Callable[[When], Text], *, under: str = "") -> None:
        """Add a row; one under another is told by both names."""
        drawn, full = value(self.drawn), value(lambda ns: format_local(ns, self._tz))
        told_name = f"{under}: {name}" if under else name
        label = f"  {name}" if under and name else name
        add_pair(self.table, label, CellValue(drawn, full.plain), told_name=told_name)

    def add_state(self, name: str, known: StateReason) -> None:
        """Add a state, what began it, and what told it last."""
        told = self._told
        self.add(name, lambda when: _state(known, told, when))
        if known.begun_by is None or known.last is None:
            return
        begun, last = known.begun_by, known.last
        self.add("begun by", lambda _: _event(begun, self._of), under=name)
        if last.number != begun.number:
            before = _length(told.time_ns - last.folds_ns)
            count = f"the last of {known.times_told} reports, {before} earlier"
            self.add(
                "last report", lambda _: _event(last, self._of).append(f"; {count}"), under=name
            )

    def drawn(self, ns: int) -> str:
        """Return a time: without the date on the day that is asked about."""
        day, _, clock = format_short(ns, self._tz).partition(" ")
        return clock if day == self._day else f"{day} {clock}"

    def drawn_span(self, first_ns: int, last_ns: int) -> str:
        """Return two times: with the dates of both, if one is of another day."""
        both = [format_short(ns, self._tz) for ns in (first_ns, last_ns)]
        if all(said.startswith(f"{self._day} ") for said in both):
            both = [self.drawn(first_ns), self.drawn(last_ns)]
        return " to ".join(both)


def _class_told(told: Explanation) -> ObjectClass:
    """Return what a log tells something of."""
    door = told.true.door or told.believed.door
    return DOOR if door is None else door.object_class


def _called(told: Explanation) -> str:
    door = told.true.door or told.believed.door
    number = str(told.door_id)
    name = "" if told.label == number else f" ({printable(told.label)})"
    unplaced = ", unplaced" if door is not None and not door.is_placed else ""
    return f"{number}{name}{unplaced}"


def _state(known: StateReason, told: Explanation, when: When) -> Text:
    """Return a state and since when; or that the door was not there."""
    if known.state is None:
        if known.since_ns is None:
            return Text("not yet in the map", style=OTHER_STATE_COLOUR)
        gone = _length(told.time_ns - known.since_ns)
        return Text(f"removed at {when(known.since_ns)}, {gone} before", style=OTHER_STATE_COLOUR)
    assert known.since_ns is not None, "a door that is there has a state since some time"
    lasted = _length(told.time_ns - known.since_ns)
    said = f" since {when(known.since_ns)}, for {lasted}"
    return _coloured(known.state, _class_told(told)).append(said)


def _coloured(state: DoorState, of: ObjectClass, said: str = "") -> Text:
    """Return a state, or what is said of it, in its colour; what is appended has none."""
    return Text.assemble((said or of.word(state), STATE_COLOURS.get(state, OTHER_STATE_COLOUR)))


def _event(entry: HistoryEntry, of: ObjectClass) -> Text:
    """Return an event in a sentence: its number, what it says, who and why, what was before."""
    said = [f"{words_of(entry.event, of, in_full=True)}{taken_back(entry)}{_who(entry)}"]
    known = values_before(entry, of)
    if len(known) == 1:
        said.append(f"before that {known[0][1]}")
    elif known:
        before = ", ".join(f"{field} {value}" for field, value in known)
        said.append(f"before that {before}")
    late_ns = entry.recorded_ns - entry.happened_ns
    if late_ns > LATE_NS:
        said.append(f"recorded {_length(late_ns)} later")
    elif late_ns < 0:
        said.append("its clock was ahead")
    return Text(f"event {entry.number}: {printable('; '.join(said))}")


def _length(ns: int) -> str:
    """Return a length of time in whole words: `2 days 3 hours`, `1 minute`."""
    parts = iter(duration(ns).split())
    return " ".join(f"{count} {UNIT_WORDS[unit]}{'s' * (count != '1')}" for count, unit in
                    zip(parts, parts, strict=True))  # fmt: skip


def _who(entry: HistoryEntry) -> str:
    """Return who did it, with what, why, and what it belongs to."""
    actor = f", by {entry.actor}" if entry.actor else ""
    source = f"{'' if actor else ','} with {entry.source}" if entry.source else ""
    reason = f": {entry.reason}" if entry.reason else ""
    correlation = f" ({entry.correlation})" if entry.correlation else ""
    return printable(f"{actor}{source}{reason}{correlation}")


def _add_believed(rows: _Rows, told: Explanation) -> None:
    """Add what was believed where it was not what is true, and what made the difference."""
    if told.agrees:
        rows.add("believed", lambda _: Text("the same"))
        return
    if told.known_event == -1:
        rows.add("believed", lambda _: Text("nothing: no event had been recorded by then"))
    else:
        rows.add_state("believed", told.believed)
    if (wrong := told.taken_back) is not None:
        rows.add("because", lambda when: _was_taken_back(told, wrong, when), under="believed")
    if (late := told.told_since) is not None:
        rows.add("because", lambda when: _was_told_late(late, when), under="believed")


def _was_taken_back(told: Explanation, wrong: HistoryEntry, when: When) -> Text:
    by = told.retractions[wrong.retracted_by or 0]
    return Text(
        f"event {wrong.number} was taken back later, at {when(by.recorded_ns)} by event "
        f"{by.number}{_who(by)}"
    )


def _was_told_late(late: HistoryEntry, when: When) -> Text:
    after = _length(late.recorded_ns - late.folds_ns)
    return Text(
        f"event {late.number} was recorded later, at {when(late.recorded_ns)}, {after} after it "
        "happened"
    )


def _add_otherwise(rows: _Rows, told: Explanation) -> None:
    """Add the events nearest to the moment that tell another state."""
    if told.true.state is None:
        return
    if not told.otherwise:
        rows.add(OTHERS, lambda _: Text("none"))
        return
    nearest = sorted(told.otherwise, key=lambda entry: abs(entry.folds_ns - told.time_ns))
    shown = nearest[:MOST_OTHERWISE]
    name = OTHERS
    for entry in told.otherwise:
        if entry in shown:
            _add_one_otherwise(rows, name, entry, _class_told(told))
            name = ""
    if len(told.otherwise) > len(shown):
        more = f"… and {len(told.otherwise) - len(shown)} more, farther away; --json has all"
        rows.add("", lambda _: Text(more), under=OTHERS)


def _add_one_otherwise(rows: _Rows, name: str, entry: HistoryEntry, of: ObjectClass) -> None:
    under = "" if name else OTHERS
    rows.add(
        name, lambda when: Text(f"{when(entry.folds_ns)} ").append(_event(entry, of)), under=under
    )


def _p_open(told: Explanation) -> Text:
    """Return P(open) as it could be known then; where it is not, why."""
    belief = told.belief
    if belief is None:
        gone = "had been removed" if told.believed.is_removed else "was not known then"
        return Text(f"UNKNOWN: the door {gone}", style=OTHER_STATE_COLOUR)
    if not belief.is_known:
        why = f": {why_unknown(belief.evidence)}" if isinstance(belief, DoorBelief) else ""
        return Text(f"UNKNOWN{why}", style=OTHER_STATE_COLOUR)
    likely = DoorState.OPEN if belief.p_open >= LIKELY else DoorState.CLOSED
    of = _class_told(told)
    said = _coloured(likely, of, _number(belief.p_open))
    if _number(belief.low) != _number(belief.high):
        said.append(f", with 90 % certainty {belief.low:.2f} to {belief.high:.2f}")
    is_against = told.believed.state in STATE_COLOURS and told.believed.state is not likely
    return said.append("; against what was believed" if is_against else "")


def _number(probability: float) -> str:
    """Return a probability in two digits, or that it is below or above what these can say."""
    if probability < 0.005:
        return "less than 0.01"
    return "more than 0.99" if probability >= 0.995 else f"{probability:.2f}"


def _next(told: Explanation, when: When) -> Text:
    """Return what came after."""
    change, of = told.next, _class_told(told)
    if change is not None:
        named = Text("removed") if change.state is None else _coloured(change.state, of)
        later = _length(change.time_ns - told.time_ns)
        return named.append(f" at {when(change.time_ns)}, {later} later; ").append(
            _event(change.entry, of)
        )
    if told.time_ns > told.end_ns:
        before = _length(told.time_ns - told.end_ns)
        return Text(f"not known: the log ends {before} before, at {when(told.end_ns)}")
    return Text(f"none up to the log's end, {when(told.end_ns)}")


def _caption(told: Explanation, rows: _Rows) -> str:
    """Return what the names of the rows mean."""
    span = rows.drawn_span(*told.otherwise_ns)
    notes = ["true: by all that is known today"]
    if told.known_event is not None:
        known = "" if told.known_event < 0 else f", up to event {told.known_event}"
        notes.append(f"believed: by what had been recorded at the moment{known}")
    if told.true.state is not None:
        notes.append(f"other reports: events that say another state, from {span}")
    notes.append("P(open): the probability that it was open, by what was known at the moment")
    return "\n".join(notes)
