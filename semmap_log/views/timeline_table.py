"""Tables of a door's timeline, best times, explanation and evaluation, for people.

A timeline has a row for each interval, and how much of the time the door was open. A sighting holds
only for a time: a separate column shows how much of an interval the door was not seen. An
explanation has a row for each fact, all on one screen. An evaluation has a row for each estimator,
with the best figures marked, then a row for each door.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from types import MappingProxyType

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.best_times import BestTime, LikelyHours
from semmap_log.analysis.beliefs.door_beliefs import DoorBelief
from semmap_log.analysis.beliefs.evaluation import Evaluation
from semmap_log.analysis.probabilities.evidence.coverage import DAY_NAMES, HOURS, spans_in_short
from semmap_log.analysis.probabilities.scores import Scores
from semmap_log.core.folds.explanation import Explanation, StateReason
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.folds.timeline import Hold, Interval, Timeline
from semmap_log.core.model.doors import DOOR, DoorId, DoorState, ObjectClass
from semmap_log.core.model.moments import SECOND_NS, duration, format_local, format_short
from semmap_log.core.texts import counted, percent
from semmap_log.views import column_table, tables
from semmap_log.views.belief_words import moment_text, why_unknown, with_interval
from semmap_log.views.event_words import printable, words_of


def best_time_table(found: BestTime) -> RenderableType:
    """Return the best hours of the week, the next ones, the wait, and the unknown hours."""
    now, label = found.now, printable(found.now.door.label)
    if not found.is_known:
        return Text(f"{label}: UNKNOWN, {why_unknown(now.evidence)}.")
    next_ones = [_from_to(window, found.tz) for window in found.next_ones]
    of_the_week = [_of_week(window) for window in found.of_the_week]
    return Group(
        _table(f"{label} {found.state}, from now on", found.next_ones, next_ones, name="next"),
        Text(),
        _table("in a typical week", found.of_the_week, of_the_week, name="of_the_week"),
        *(Text(line, style="dim") for line in _notes(found)),
    )


def _table(
    title: str, windows: Sequence[LikelyHours], when: Sequence[str], *, name: str
) -> column_table.ColumnTable:
    table = column_table.ColumnTable([
        column_table.TableColumn(name, title, least=len("Mon 2026-03-02 08:00 to Tue 09:00")),
        column_table.TableColumn("", "P (90 % interval)"),
        column_table.TableColumn("p"),
        column_table.TableColumn("low"),
        column_table.TableColumn("high"),
    ], gap=2)  # fmt: skip
    for window, said in zip(windows, when, strict=True):
        numbers = (window.probability, window.low, window.high)
        table.add(said, with_interval(*numbers), *(f"{number:.4f}" for number in numbers))
    return table


def _from_to(window: LikelyHours, tz: str) -> str:
    """Return `Mon 2026-03-02 08:00 to 12:00`, with the day again where it is another."""
    start, end = (format_short(ns, tz, seconds=False) for ns in (window.start_ns, window.end_ns))
    last_hour = window.first_hour + window.hours
    day = DAY_NAMES[window.first_hour // HOURS]
    last_date, _, until = end.partition(" ")
    if not start.startswith(last_date) and until != "00:00":
        until = f"{DAY_NAMES[last_hour // HOURS % 7]} {until}"
    return f"{day} {start} to {'24:00' if until == '00:00' else until}"


def _of_week(window: LikelyHours) -> str:
    """Return `Mon 08:00 to 12:00`."""
    first, last = window.first_hour, window.first_hour + window.hours
    until = f"{(last - 1) % HOURS + 1:02}:00"
    if (last - 1) // HOURS != first // HOURS:
        until = f"{DAY_NAMES[(last - 1) // HOURS % 7]} {until}"
    return f"{DAY_NAMES[first // HOURS]} {first % HOURS:02}:00 to {until}"


def _wait(found: BestTime) -> str:
    """Return `2 h 10 min (1 h 40 min to 3 h)`, the interval where there is a wait."""
    assert found.wait_s is not None
    assert found.wait_interval_s is not None
    mean, least, most = (
        duration(round(seconds) * SECOND_NS) for seconds in (found.wait_s, *found.wait_interval_s)
    )
    return mean if least == most else f"{mean} ({least} to {most})"


def _notes(found: BestTime) -> list[str]:
    now = found.now
    said = with_interval(now.p_open, now.low, now.high) if now.is_known else "UNKNOWN"
    notes = [f"now, {moment_text(now.known_ns, found.tz)} ({found.tz}): P(open) {said}"]
    if found.wait_s is not None:
        notes.append(f"expected wait until {found.state}: {_wait(found)}")
    if found.never_seen.any():
        notes.append(f"left out, never seen then: {spans_in_short(found.never_seen)}")
    return notes


MOST_OTHERWISE = 5
"""So many contradicting events are shown, nearest to the moment first; `--json` has all."""
LIKELY = 0.5
OTHERS = "other reports"
UNIT_WORDS = {"d": "day", "h": "hour", "min": "minute", "s": "second"}

When = Callable[[int], str]
"""How a time is written."""


def explanation_table(told: Explanation, *, tz: str) -> RenderableType:
    """Return a table that explains a door's state at a moment.

    Args:
        told: The explanation.
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
    """Names and values; times are short when drawn, and complete for programs."""

    def __init__(self, told: Explanation, tz: str) -> None:
        self.table: column_table.PairTable = column_table.pairs()
        self._told = told
        self._tz = tz
        self._of = _class_explained(told)
        self._day = format_short(told.time_ns, tz).partition(" ")[0]

    def add(self, name: str, value: Callable[[When], Text], *, under: str = "") -> None:
        """Add a row; programs see a row under another by both names."""
        drawn, full = value(self.drawn), value(lambda ns: format_local(ns, self._tz))
        machine_name = f"{under}: {name}" if under else name
        label = f"  {name}" if under and name else name
        column_table.add_pair(
            self.table, label, column_table.CellValue(drawn, full.plain), machine_name=machine_name
        )

    def add_state(self, name: str, known: StateReason) -> None:
        """Add a state, the event that began it, and the last event that reported it."""
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
        """Return a time, without its date on the day of the queried moment."""
        day, _, clock = format_short(ns, self._tz).partition(" ")
        return clock if day == self._day else f"{day} {clock}"

    def drawn_span(self, first_ns: int, last_ns: int) -> str:
        """Return two times: with the dates of both, if one is of another day."""
        both = [format_short(ns, self._tz) for ns in (first_ns, last_ns)]
        if all(said.startswith(f"{self._day} ") for said in both):
            both = [self.drawn(first_ns), self.drawn(last_ns)]
        return " to ".join(both)


def _class_explained(told: Explanation) -> ObjectClass:
    """Return the class of the object that the explanation is about."""
    door = told.true.door or told.believed.door
    return DOOR if door is None else door.object_class


def _called(told: Explanation) -> str:
    door = told.true.door or told.believed.door
    number = str(told.door_id)
    name = "" if told.label == number else f" ({printable(told.label)})"
    unplaced = ", unplaced" if door is not None and not door.is_placed else ""
    return f"{number}{name}{unplaced}"


def _state(known: StateReason, told: Explanation, when: When) -> Text:
    """Return a state and since when, or that the door was not in the map."""
    if known.state is None:
        if known.since_ns is None:
            return Text("not yet in the map", style=tables.OTHER_STATE_COLOUR)
        gone = _length(told.time_ns - known.since_ns)
        return Text(
            f"removed at {when(known.since_ns)}, {gone} before", style=tables.OTHER_STATE_COLOUR
        )
    assert known.since_ns is not None, "a door that is there has a state since some time"
    lasted = _length(told.time_ns - known.since_ns)
    said = f" since {when(known.since_ns)}, for {lasted}"
    return _coloured(known.state, _class_explained(told)).append(said)


def _coloured(state: DoorState, of: ObjectClass, said: str = "") -> Text:
    """Return a state, or its description, in its colour; text that is appended has none."""
    return Text.assemble(
        (said or of.word(state), tables.STATE_COLOURS.get(state, tables.OTHER_STATE_COLOUR))
    )


def _event(entry: HistoryEntry, of: ObjectClass) -> Text:
    """Return an event in a sentence: its number, what it says, who and why, what was before."""
    said = [f"{words_of(entry.event, of, in_full=True)}{tables.taken_back(entry)}{_who(entry)}"]
    known = tables.values_before(entry, of)
    if len(known) == 1:
        said.append(f"before that {known[0][1]}")
    elif known:
        before = ", ".join(f"{field} {value}" for field, value in known)
        said.append(f"before that {before}")
    late_ns = entry.recorded_ns - entry.happened_ns
    if late_ns > tables.LATE_NS:
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
    """Add what was believed if it differs from the truth, and the reason."""
    if told.agrees:
        rows.add("believed", lambda _: Text("the same"))
        return
    if told.known_event == -1:
        rows.add("believed", lambda _: Text("nothing: no event had been recorded by then"))
    else:
        rows.add_state("believed", told.believed)
    if (wrong := told.taken_back) is not None:
        rows.add("because", lambda when: _was_retracted(told, wrong, when), under="believed")
    if (late := told.told_since) is not None:
        rows.add("because", lambda when: _recorded_late(late, when), under="believed")


def _was_retracted(told: Explanation, wrong: HistoryEntry, when: When) -> Text:
    by = told.retractions[wrong.retracted_by or 0]
    return Text(
        f"event {wrong.number} was taken back later, at {when(by.recorded_ns)} by event "
        f"{by.number}{_who(by)}"
    )


def _recorded_late(late: HistoryEntry, when: When) -> Text:
    after = _length(late.recorded_ns - late.folds_ns)
    return Text(
        f"event {late.number} was recorded later, at {when(late.recorded_ns)}, {after} after it "
        "happened"
    )


def _add_otherwise(rows: _Rows, told: Explanation) -> None:
    """Add the events nearest to the moment that report another state."""
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
            _add_one_otherwise(rows, name, entry, _class_explained(told))
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
    """Return P(open) as of the knowledge then, or why it is unknown."""
    belief = told.belief
    if belief is None:
        gone = "had been removed" if told.believed.is_removed else "was not known then"
        return Text(f"UNKNOWN: the door {gone}", style=tables.OTHER_STATE_COLOUR)
    if not belief.is_known:
        why = f": {why_unknown(belief.evidence)}" if isinstance(belief, DoorBelief) else ""
        return Text(f"UNKNOWN{why}", style=tables.OTHER_STATE_COLOUR)
    likely = DoorState.OPEN if belief.p_open >= LIKELY else DoorState.CLOSED
    of = _class_explained(told)
    said = _coloured(likely, of, _number(belief.p_open))
    if _number(belief.low) != _number(belief.high):
        said.append(f", with 90 % certainty {belief.low:.2f} to {belief.high:.2f}")
    is_against = told.believed.state in tables.STATE_COLOURS and told.believed.state is not likely
    return said.append("; against what was believed" if is_against else "")


def _number(probability: float) -> str:
    """Return a probability in two digits, or that it is below or above what these can say."""
    if probability < 0.005:
        return "less than 0.01"
    return "more than 0.99" if probability >= 0.995 else f"{probability:.2f}"


def _next(told: Explanation, when: When) -> Text:
    """Return what came after."""
    change, of = told.next, _class_explained(told)
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


Names = Mapping[DoorId, str]

MOST_DOORS = 40
"""So many are shown one by one."""
MOST_ESTIMATORS = 5
"""Columns that fit for single doors: the estimators that are best on average."""
BEST = "*"
FIGURES = ("brier", "log_loss", "ece", "bias")
HEADS = ("Brier", "log-loss", "ECE", "bias")
NAME_WIDTH = 14


def evaluation_table(
    evaluation: Evaluation, *, names: Names = MappingProxyType({})
) -> RenderableType:
    """Return the figures of an evaluation, in 80 columns.

    Args:
        evaluation: The evaluation.
        names: The doors' names.
    """
    parts: list[RenderableType] = [_means(evaluation)]
    if len(evaluation.doors) > 1:
        parts += [Text(), _doors(evaluation, names)]
        more = len(evaluation.doors) - MOST_DOORS
        if more > 0:
            parts.append(Text(f"and {counted(more, 'door')} more: --json has all", style="dim"))
    parts += [Text(), Text(_said(evaluation), style="dim")]
    return Group(*parts)


def _means(evaluation: Evaluation) -> column_table.ColumnTable:
    mean = evaluation.mean
    best = {figure: _best(mean, figure) for figure in FIGURES}
    heads = zip(FIGURES, HEADS, range(len(FIGURES)), strict=True)
    table = column_table.ColumnTable(
        [
            column_table.TableColumn("estimator", "estimator", least=NAME_WIDTH),
            *(
                column_table.TableColumn(name, head, right=True, yields=place)
                for name, head, place in heads
            ),
        ]
    )
    for name, scores in mean.items():
        cells = [_cell(scores, figure, is_best=best[figure] == name) for figure in FIGURES]
        table.add(printable(name), *cells)
    return table


def _doors(evaluation: Evaluation, names: Names) -> RenderableType:
    """Return the Brier scores of each door; of many doors or estimators, a part is drawn."""
    mean = evaluation.mean
    ranked = sorted(mean, key=lambda name: mean[name].brier or 0.0)[:MOST_ESTIMATORS]
    drawn = _brier_scores(evaluation, names, [name for name in mean if name in ranked], MOST_DOORS)
    return column_table.TextPicture(
        lambda _: drawn, _brier_scores(evaluation, names, list(mean), None)
    )


def _brier_scores(
    evaluation: Evaluation, names: Names, estimators: list[str], most: int | None
) -> column_table.ColumnTable:
    mean = evaluation.mean
    worst_first = sorted(estimators, key=lambda name: -(mean[name].brier or 0.0))
    table = column_table.ColumnTable([
        column_table.TableColumn("door", "door (Brier)", least=NAME_WIDTH),
        *(column_table.TableColumn(f"brier_{name}", printable(name), right=True, least=7,
                 yields=max(0, len(worst_first) - 1 - worst_first.index(name)))
          for name in estimators),
    ])  # fmt: skip
    for door in evaluation.doors[:most]:
        best = _best(door.scores, "brier")
        cells = [_cell(door.scores[name], "brier", is_best=name == best) for name in estimators]
        table.add(printable(names.get(door.door_id, str(door.door_id))), *cells)
    return table


def _best(scores: Mapping[str, Scores], figure: str) -> str | None:
    """Return the estimator whose figure is nearest to 0; a single one is never the best."""
    if len(scores) < 2:
        return None
    return min(scores, key=lambda name: abs(getattr(scores[name], figure)))


def _cell(scores: Scores, figure: str, *, is_best: bool) -> column_table.Cell:
    value = getattr(scores, figure)
    said = f"{value:+.4f}" if figure == "bias" else f"{value:.4f}"
    return column_table.CellValue(
        Text(f"{said}{BEST if is_best else ' '}", style="bold" if is_best else ""), said
    )


def _said(evaluation: Evaluation) -> str:
    """Return in words what was forecast, and from what."""
    tests = sum(door.tests for door in evaluation.doors)
    unit = "sample" if evaluation.is_truth else "reading"
    after = f"{counted(tests, unit)} after the first {evaluation.protocol.split:.0%}"
    lines = [
        f"{counted(len(evaluation.doors), 'door')}, {after}; mean over doors, {BEST} best",
        known_text(evaluation),
    ]
    if evaluation.left_out:
        lines.append(
            f"left out, with too little known time: {counted(len(evaluation.left_out), 'door')}"
        )
    return "\n".join(lines)


def known_text(evaluation: Evaluation) -> str:
    """Return the knowledge at each forecast: `known at each forecast: all up to 1 h before it`."""
    protocol = evaluation.protocol
    what = "all"
    if (patrol := protocol.patrol) is not None:
        what = (
            f"what a visit each {duration(patrol.interval_ns)} read, right "
            f"{percent(patrol.accuracy)} of the time (seed {patrol.seed}),"
        )
    return f"known at each forecast: {what} up to {_until_text(evaluation)}"


def _until_text(evaluation: Evaluation) -> str:
    protocol = evaluation.protocol
    earlier = f"{duration(protocol.horizon_ns)} before it" if protocol.horizon_ns else ""
    if protocol.prequential:
        return f"the midnight before {f'what was {earlier}' if earlier else 'it'}"
    if earlier:
        return earlier
    if protocol.patrol is not None or not evaluation.is_truth or protocol.horizon_ns is not None:
        return "its moment"
    return "the split"


PAGE_ROWS = 500
TIME_WIDTH = len("2026-03-02 08:00:00")


def timeline_pages(
    timeline: Timeline, *, tz: str, of: ObjectClass = DOOR
) -> Iterator[column_table.ColumnTable]:
    """Yield the intervals as tables whose columns line up; the first has the head.

    Args:
        timeline: A door's.
        tz: IANA zone of the times.
        of: The class of the timeline's object.
    """
    waiting = iter(timeline)
    page = list(islice(waiting, PAGE_ROWS))
    is_first = True
    while page or is_first:
        yield _page(page, of, tz=tz, show_header=is_first)
        page, is_first = list(islice(waiting, PAGE_ROWS)), False


def timeline_totals(timeline: Timeline, *, tz: str, of: ObjectClass = DOOR) -> Text:
    """Return how much of the known time the door was open, and how the timeline ends, in words.

    After a sighting no longer holds, the state is unknown: the door was not seen since.
    """
    opened, closed = timeline.total_ns(DoorState.OPEN), timeline.total_ns(DoorState.CLOSED)
    known, whole = opened + closed, int(timeline.duration_ns.sum())
    not_seen = int(timeline.not_seen_ns.sum())
    is_open, is_closed = (of.word(s).lower() for s in (DoorState.OPEN, DoorState.CLOSED))
    said = f"never known to be {is_open} or {is_closed} for any time"
    if known:
        said = (
            f"{is_open} {opened / known:.1%}, {is_closed} {closed / known:.1%} "
            f"of the {duration(known)} in which that was known"
        )
        if whole > known:
            said += f" ({known / whole:.1%})"
    if not_seen:
        said += f"\nnot seen for {duration(not_seen)} ({not_seen / whole:.1%})"
    if (since_ns := timeline.not_seen_since_ns) is not None:
        said += f", not since {format_local(since_ns, tz)}"
    end = format_local(int(timeline.end_ns[-1]), tz)
    ending = "removed at" if timeline.removed else "up to"
    return Text(f"{said}\n{hold_text(timeline.hold)}\n{ending} {end} ({tz})", style="dim")


def hold_text(hold: Hold | None) -> str:
    """Return how long a sighting of a door holds, and why."""
    if hold is None:
        return "a sighting holds until the next report"
    if hold.is_measured:
        gaps = f"{counted(hold.gaps, 'median gap')} between looks"
        return f"a sighting holds for {duration(hold.ns)} ({gaps})"
    tell = "tells" if hold.looks == 1 else "tell"
    looks = f"{counted(hold.looks, 'look')} {tell} no median gap"
    gaps = f"{counted(hold.gaps, 'gap')} of {duration(hold.gap_ns)}"
    return f"a sighting holds for {duration(hold.ns)} ({gaps}, as {looks})"


def _page(
    intervals: list[Interval], of: ObjectClass, *, tz: str, show_header: bool
) -> column_table.ColumnTable:
    table = column_table.ColumnTable(COLUMNS, has_head=show_header)
    for interval in intervals:
        ends = interval.start_ns, interval.end_ns
        table.add(
            *(column_table.CellValue(_drawn_time(ns, tz), format_local(ns, tz)) for ns in ends),
            duration(interval.duration_ns),
            f"{interval.duration_ns / SECOND_NS:.3f}",
            tables.coloured_state(interval.state, of),
            str(interval.sightings),
            str(interval.event),
            _not_seen(interval),
        )
    return table


def _not_seen(interval: Interval) -> column_table.CellValue:
    """Return the share of an interval in which no sighting held; for programs, seconds."""
    share = f"{interval.not_seen_ns / interval.duration_ns:.0%}" if interval.not_seen_ns else ""
    return column_table.CellValue(share, f"{interval.not_seen_ns / SECOND_NS:.3f}")


def _drawn_time(ns: int, tz: str) -> str:
    """Return an instant; an offset stands in a line of its own."""
    return column_table.with_line_end(format_short(ns, tz), TIME_WIDTH)


COLUMNS = [
    column_table.TableColumn("since", "since", width=TIME_WIDTH),
    column_table.TableColumn("until", "until", width=TIME_WIDTH, yields=1),
    column_table.TableColumn("", "lasted", width=len("23 h 59 min"), right=True),
    column_table.TableColumn("seconds"),
    column_table.TableColumn("state", "state", width=len(DoorState.UNKNOWN.name)),
    column_table.TableColumn("seen", "seen", width=5, right=True, yields=2),
    column_table.TableColumn("event", "event", width=len("9999999"), right=True, yields=3),
    column_table.TableColumn(
        "not_seen_seconds", "unseen", width=len("unseen"), right=True, yields=1
    ),
]
