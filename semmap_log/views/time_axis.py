"""Ticks of a time axis by a building's clocks, and their labels: none covers another.

Each tick is what its label says: a time of day, or the first moment of a day, a month, a year.
Where clocks are turned back, a tick that comes a second time shows its offset from UTC. The
report's page does the same in `page/ticks.js`; a test keeps the two equal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import partial

from semmap_log.analysis.probabilities.evidence.coverage import DAY_NAMES

SECOND_MS = 1000
MINUTE_MS = 60 * SECOND_MS
HOUR_MS = 60 * MINUTE_MS
DAY_MS = 24 * HOUR_MS
MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
MINUS = "\N{MINUS SIGN}"
EPOCH = date(1970, 1, 1).toordinal()
FIRST_MONDAY = 4
"""Days after 1970-01-01, as all days are counted here."""
FOREVER_MS = 2**60

CLOCK_STEPS_MS = (
    *(n * SECOND_MS for n in (1, 2, 5, 10, 15, 30)),
    *(n * MINUTE_MS for n in (1, 2, 5, 10, 15, 30)),
    *(n * HOUR_MS for n in (1, 2, 3, 6, 12)),
)
"""Each a part of a day."""
DAY_STEPS = (1, 2, 7, 14)
MONTH_STEPS = (1, 2, 3, 6)
YEAR_STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)

STEP_GAP, LEAST_GAP = 2, 1
"""Between labels, in letters: where the step is chosen, and where clocks are changed."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A mark on the axis."""

    at_ms: int
    """Since the Unix epoch."""
    label: str
    """The label; empty: there is no room for one."""
    begins_day: bool
    """It is the first moment of a local day."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A time in which the clocks were not changed, [from_ms, till_ms)."""

    from_ms: int
    till_ms: int
    ahead_ms: int
    """Of UTC."""
    before_ms: int
    """The same until then."""


class WallClock:
    """A zone's clocks."""

    def __init__(self, offsets: Sequence[tuple[int, int]]) -> None:
        """Args: offsets: (from when, milliseconds since the epoch; ahead of UTC, seconds)."""
        begins = [-FOREVER_MS, *(ms for ms, _ in offsets[1:]), FOREVER_MS]
        ahead = [1000 * seconds for _, seconds in offsets]
        self.stretches = [
            Stretch(begins[i], begins[i + 1], ahead[i], ahead[max(i - 1, 0)])
            for i in range(len(offsets))
        ]

    def wall_ms(self, at_ms: int) -> int:
        """Return what the clocks show, as if it was UTC."""
        return next(at_ms + s.ahead_ms for s in reversed(self.stretches) if s.from_ms <= at_ms)

    def day(self, at_ms: int) -> int:
        """Return the local day of a moment."""
        return self.wall_ms(at_ms) // DAY_MS

    def begin_of(self, day: int) -> int:
        """Return the first moment of a local day; of a skipped day, that of the next."""
        begins = ((max(s.from_ms, day * DAY_MS - s.ahead_ms), s.till_ms) for s in self.stretches)
        return next(at_ms for at_ms, till_ms in begins if at_ms < till_ms)


def time_ticks(
    start_ms: int,
    end_ms: int,
    clock: WallClock,
    *,
    letters: float,
    short: bool = False,
    anchor: float = 0.0,
) -> list[Tick]:
    """Return the ticks from one moment to another, both included, ascending.

    Args:
        start_ms: Where the axis begins, milliseconds since the Unix epoch.
        end_ms: Where it ends.
        clock: The clock of the labels.
        letters: How long it is, in widths of a letter.
        short: Label days without their weekday, and months other than January without their year.
        anchor: The part of a label that stands before its tick: 0, or .5 if they are centred.
    """
    length_ms = max(end_ms - start_ms, 1)
    place = _Axis(start_ms, end_ms, clock, short)
    day_letters, month_letters = (6, 4) if short else (10, 8)
    steps: list[tuple[int, int, Callable[[], Iterator[Tick]]]] = [
        *((ms, 8 if ms < MINUTE_MS else day_letters, partial(place.times, ms))
          for ms in CLOCK_STEPS_MS),
        *((n * DAY_MS, day_letters, partial(place.days, n)) for n in DAY_STEPS),
        *((n * 28 * DAY_MS, month_letters, partial(place.months, n)) for n in MONTH_STEPS),
        *((n * 365 * DAY_MS, 4, partial(place.months, 12 * n)) for n in YEAR_STEPS),
    ]  # fmt: skip
    fitting = (make for ms, wide, make in steps
               if ms / length_ms * letters >= wide + STEP_GAP)  # fmt: skip
    ticks = next(fitting, steps[-1][2])()
    return _labelled(list(ticks), lambda ms: (ms - start_ms) / length_ms * letters, letters, anchor)


@dataclass(frozen=True, slots=True)
class _Axis:
    start_ms: int
    end_ms: int
    clock: WallClock
    short: bool

    def times(self, step_ms: int) -> Iterator[Tick]:
        """Yield the times of day that a step marks, and each day's first moment."""
        marks = dict(self._clock_marks(step_ms))
        begins = {tick.at_ms: tick for tick in self.days(1)}
        for at_ms in sorted(marks.keys() | begins.keys()):
            yield begins.get(at_ms) or Tick(at_ms, marks[at_ms], begins_day=False)

    def _clock_marks(self, step_ms: int) -> Iterator[tuple[int, str]]:
        for stretch in self.clock.stretches:
            low, high = max(stretch.from_ms, self.start_ms), min(stretch.till_ms, self.end_ms + 1)
            first_ms = -(-(low + stretch.ahead_ms) // step_ms) * step_ms - stretch.ahead_ms
            for at_ms in range(first_ms, high, step_ms):
                wall_ms = at_ms + stretch.ahead_ms
                said = _clock_text(wall_ms, seconds=step_ms < MINUTE_MS)
                comes_again = wall_ms < stretch.from_ms + stretch.before_ms
                if comes_again and at_ms - step_ms < stretch.from_ms:
                    said += f" {_offset_text(stretch.ahead_ms)}"
                yield at_ms, said

    def days(self, step: int) -> Iterator[Tick]:
        """Yield the first moments of days; weeks begin on Mondays."""
        first = self.clock.day(self.start_ms)
        phase = FIRST_MONDAY if step % 7 == 0 else 0
        first += (phase - first) % step
        for day in range(first, self.clock.day(self.end_ms) + 2, step):
            yield from self._begin(day, day + 1, _day_text(day, short=self.short))

    def months(self, step: int) -> Iterator[Tick]:
        """Yield the first moments of months, or of years."""
        first = _month_of(self.clock.day(self.start_ms))
        first += -first % step
        for month in range(first, _month_of(self.clock.day(self.end_ms)) + 2, step):
            year, place = divmod(month, 12)
            said = f"{MONTHS[place]} {year}" if not self.short else MONTHS[place]
            if step % 12 == 0 or (self.short and place == 0):
                said = str(year)
            yield from self._begin(_first_day(month), _first_day(month + 1), said)

    def _begin(self, day: int, next_day: int, said: str) -> Iterator[Tick]:
        """Yield the first moment of some days, unless it is outside or the days were skipped."""
        at_ms = self.clock.begin_of(day)
        if self.start_ms <= at_ms <= self.end_ms and self.clock.day(at_ms) < next_day:
            yield Tick(at_ms, said, begins_day=True)


def _labelled(
    ticks: list[Tick], place: Callable[[int], float], letters: float, anchor: float
) -> list[Tick]:
    """Return the ticks without the labels for which there is no room.

    Days have priority over times, and repeated times over others.
    """
    taken: list[tuple[float, float]] = []
    kept: set[int] = set()
    wanted = sorted(ticks, key=lambda tick: (not tick.begins_day, " " not in tick.label))
    for tick in wanted:
        left = place(tick.at_ms) - anchor * len(tick.label)
        right = left + len(tick.label)
        fits = right <= letters + anchor * len(tick.label)
        if fits and all(right + LEAST_GAP <= a or left >= b + LEAST_GAP for a, b in taken):
            taken.append((left, right))
            kept.add(tick.at_ms)
    return [tick if tick.at_ms in kept else replace(tick, label="") for tick in ticks]


def _clock_text(wall_ms: int, *, seconds: bool) -> str:
    of_day = wall_ms % DAY_MS
    minutes, second = divmod(of_day // SECOND_MS, 60)
    said = f"{minutes // 60:02}:{minutes % 60:02}"
    return f"{said}:{second:02}" if seconds else said


def _offset_text(ahead_ms: int) -> str:
    sign = MINUS if ahead_ms < 0 else "+"
    return sign + _clock_text(abs(ahead_ms), seconds=False)


def _day_text(day: int, *, short: bool) -> str:
    on = date.fromordinal(day + EPOCH)
    said = f"{on.day} {MONTHS[on.month - 1]}"
    return said if short else f"{DAY_NAMES[on.weekday()]} {said}"


def _month_of(day: int) -> int:
    on = date.fromordinal(day + EPOCH)
    return 12 * on.year + on.month - 1


def _first_day(month: int) -> int:
    return date(month // 12, month % 12 + 1, 1).toordinal() - EPOCH
