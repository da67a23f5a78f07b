"""Moments as people write them, and instants as we print them.

An instant is an integer number of nanoseconds since the Unix epoch, UTC. Text without an offset is
local time of a zone: in the hour that comes twice in autumn the first is meant, and an hour that
spring skips is an error.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, datetime, timedelta, timezone
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.lazily import late_pattern
from semmap_log.core.model.events import MAX_EVENT, is_whole_number
from semmap_log.errors import MomentError

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

SECOND_NS = 1_000_000_000
HOUR_NS = 3_600 * SECOND_NS
DAY_NS = 24 * HOUR_NS
USUAL_HOLDS = 3
"""A sighting of a door holds for this many median gaps between looks, where a log says no other."""
MOST_HOLDS = 10**9 - 1
SECONDS_DIGITS, NANOSECONDS_DIGITS = 10, 18
"""`@n` counts seconds up to so many digits (2262), and nanoseconds from so many on (1973)."""
_UNITS = {range(12, 15): "milliseconds", range(15, 18): "microseconds"}
"""What a number of so many digits counts, of a time of these decades."""

INSTANTS = "2026-03-01T14:02, 2026-03-01T14:02:00.5Z, 2026-03-01 or @1772373720"
MOMENTS = f"2h ago, yesterday 14:00, 14:00, Tue 10:00, now, event:1234, {INSTANTS}"
WEEKDAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")


@dataclass(frozen=True, slots=True)
class Moment:
    """An instant, or the state just after an event: one of the two is set."""

    ns: int | None = None
    event: int | None = None


def parse_moment(
    text: str,
    *,
    tz: str,
    end_ns: Callable[[], int],
    last_ns: Callable[[], int] | None = None,
) -> Moment:
    """Return the moment that `text` names.

    Args:
        text: One of the forms of `parse_instant`, or `now`, `2h ago`, `90 min ago`,
            `yesterday 14:00`, `today 09:30`, `09:30` and `Tue 10:00` (the last ones), `event:1234`.
        tz: IANA zone of times without an offset.
        end_ns: Returns the log's end, from which `now`, `ago`, `today`, `yesterday` are counted.
        last_ns: Returns the time up to which a clock time or a weekday is the last one; default:
            `end_ns`.

    Raises:
        MomentError: None of these forms, or no such time.
    """
    text = text.strip()
    if found := _EVENT.fullmatch(text):
        event = int(found["number"])
        if event > MAX_EVENT:
            raise MomentError(f"{text!r}: expected an event number up to {MAX_EVENT}.")
        return Moment(event=event)
    if text.lower() == "now":
        return Moment(ns=end_ns())
    if found := _AGO.fullmatch(text.lower()):
        back_ns = _decimal_ns(found["count"], _UNIT_NS[found["unit"]])
        return Moment(ns=_checked(end_ns() - back_ns, text))
    if found := _LAST.fullmatch(text.lower()):
        return Moment(ns=_last_before((last_ns or end_ns)(), found, tz))
    if found := _DAY.fullmatch(text.lower()):
        day = _local(end_ns(), tz).date() - timedelta(days=found["day"] == "yesterday")
        return Moment(ns=parse_instant(f"{day}T{found['clock'] or '00:00'}", tz=tz))
    if not (text.startswith("@") or _ISO.fullmatch(text)):
        raise MomentError(f"Expected a moment such as {MOMENTS}; got {text[:60]!r}.")
    return Moment(ns=parse_instant(text, tz=tz))


def parse_weekday(text: str) -> tuple[int, int] | None:
    """Return the day of the week, from Monday's 0 on, and the hour of `Tue 10:00`; None: no such.

    Of `10:30` the hour is 10, and of `Tue` it is 0.
    """
    found = _LAST.fullmatch(text.strip().lower())
    if found is None or found["day"] is None:
        return None
    hour = int((found["clock"] or "00")[:2])
    return (_weekday(found["day"]), hour) if hour < 24 else None


def parse_duration(text: str) -> int:
    """Return a length of time in nanoseconds: `30m`, `2h`, `1.5 d`, `90 s`.

    Raises:
        MomentError: It is no length of time.
    """
    found = _DURATION.fullmatch(text.strip().lower())
    if found is None:
        raise MomentError(f"Expected a length of time such as 30m, 2h or 1.5d; got {text[:60]!r}.")
    return _decimal_ns(found["count"], _UNIT_NS[found["unit"]])


def check_ordered(since_ns: int | None, until_ns: int | None) -> None:
    """Refuse a span that ends before it begins; None: it is open there.

    Raises:
        MomentError: `since_ns` comes after `until_ns`.
    """
    if since_ns is not None and until_ns is not None and since_ns > until_ns:
        raise MomentError("the first moment lies after the second; swap them.")


def parse_range(text: str, moment: Callable[[str], Moment]) -> tuple[Moment, Moment]:
    """Return the two moments of `T1..T2`, each read by `moment`.

    Raises:
        MomentError: Not two moments with two dots between them, or the second comes first.
    """
    first, dots, last = text.partition("..")
    if not dots:
        raise MomentError(f"{text!r}: expected two moments as T1..T2, such as today..now.")
    start, end = moment(first.strip()), moment(last.strip())
    if start.ns is not None and end.ns is not None and start.ns > end.ns:
        raise MomentError(f"{text!r}: expected T1..T2 with T1 before T2; swap them.")
    return start, end


def parse_instant(value: str | float, *, tz: str) -> int:
    """Return the instant that an ISO-8601 text or a number names.

    Args:
        value: `2026-03-01`, `2026-03-01 14:02`, `2026-03-01T14:02:00.123456789+01:00`, `…Z`;
            `@n` or a number: seconds since the epoch, nanoseconds from 18 digits on.
        tz: IANA zone of a text without an offset.

    Raises:
        MomentError: Not such a time, a local time that does not exist, or outside 1970..2262.
    """
    if not isinstance(value, str):
        return _instant_of_number(_digits(value))
    return both_instants(value.strip(), tz=tz)[0]


def both_instants(text: str, *, tz: str) -> tuple[int, int]:
    """Return the instants that a text can mean: two in the hour that comes twice.

    Elsewhere, with an offset and of `@n` both are the same.

    Raises:
        MomentError: As `parse_instant`.
    """
    if text.startswith("@"):
        instant_ns = _instant_of_number(text[1:])
        return instant_ns, instant_ns
    found = _ISO.fullmatch(text)
    if found is None:
        raise MomentError(f"Expected a time such as {INSTANTS}; got {text[:60]!r}.")
    fraction_ns = int((found["fraction"] or "").ljust(9, "0"))
    try:
        first_s, second_s = _seconds(found, tz)
    except (ValueError, OverflowError) as error:
        if isinstance(error, MomentError):
            raise
        raise MomentError(f"{text!r} is not a time: {error}.") from None
    first_ns = _checked(first_s * SECOND_NS + fraction_ns, text)
    return first_ns, _checked(second_s * SECOND_NS + fraction_ns, text)


def zone(tz: str) -> ZoneInfo:
    """Return the time zone of that IANA name.

    Raises:
        MomentError: There is no such zone.
    """
    try:
        return _zone(tz)
    except (OSError, ValueError, LookupError):  # a folder's name, odd characters, no such zone
        raise MomentError(
            f"No time zone {tz!r}: expected an IANA name such as Europe/Vienna or UTC."
        ) from None


def format_utc(ns: int) -> str:
    """Return the instant as ISO-8601 UTC with nanoseconds: `2026-03-01T12:00:00.000000000Z`."""
    seconds, fraction = divmod(ns, SECOND_NS)
    whole = _EPOCH + timedelta(seconds=seconds)
    return f"{whole:%Y-%m-%dT%H:%M:%S}.{fraction:09d}Z"


def format_second(ns: int) -> str:
    """Return the second in which an instant lies, as ISO-8601 UTC: `2026-03-01T12:00:00Z`."""
    return f"{_EPOCH + timedelta(seconds=ns // SECOND_NS):%Y-%m-%dT%H:%M:%S}Z"


def format_wall(ns: int, tz: str) -> str:
    """Return the instant as the zone's wall clock shows it: `2026-03-01T13:00:00.5+01:00`.

    All of the fraction and the offset are written: `parse_instant` returns the same instant again,
    whatever zone it is given.
    """
    local = _local(ns, tz)
    fraction = f"{ns % SECOND_NS:09d}".rstrip("0")
    dot = "." if fraction else ""
    return f"{local:%Y-%m-%dT%H:%M:%S}{dot}{fraction}{_offset_text(local)}"


def format_local(ns: int, tz: str) -> str:
    """Return the instant for people: `2026-03-01 13:00:00+01:00`, milliseconds where not zero."""
    fraction_ms = ns % SECOND_NS // 1_000_000
    local = _local(ns, tz)
    shown_ms = f".{fraction_ms:03d}" if fraction_ms else ""
    return f"{local:%Y-%m-%d %H:%M:%S}{shown_ms}{_offset_text(local)}"


def format_short(ns: int, tz: str, *, seconds: bool = True) -> str:
    """Return the instant for people who see elsewhere which zone it is: `2026-03-01 13:00:00`.

    In the hour that comes twice two instants would look alike: there, and only there, the offset
    follows, as in `2025-10-26 02:30:00+01:00`.

    Args:
        ns: The instant.
        tz: IANA zone of the clock.
        seconds: Show them; else the text ends with the minutes.
    """
    local = _local(ns, tz)
    shown = f"{local:%Y-%m-%d %H:%M:%S}" if seconds else f"{local:%Y-%m-%d %H:%M}"
    return shown + (_offset_text(local) if _comes_twice(local) else "")


_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_NAIVE_EPOCH = datetime(1970, 1, 1)  # noqa: DTZ001 - wall clocks, without a zone

_ISO = late_pattern(
    r"(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)"
    r"(?:[T ](?P<hour>\d\d):(?P<minute>\d\d)(?::(?P<second>\d\d)(?:[.,](?P<fraction>\d{1,9}))?)?"
    r" ?(?P<offset>[Zz]|[+-]\d\d(?::?\d\d)?)?)?",
    re.ASCII,
)
_NUMBER = late_pattern(r"(?P<whole>\d{1,19})(?:\.(?P<fraction>\d{1,30}))?", re.ASCII)
_EVENT = late_pattern(r"event:(?P<number>\d{1,19})", re.ASCII)
_CLOCK = r"(?P<clock>\d\d:\d\d(?::\d\d(?:\.\d{1,9})?)?)"
_DAY = late_pattern(rf"(?P<day>today|yesterday)(?: +{_CLOCK})?", re.ASCII)
_LAST = late_pattern(
    rf"(?:(?P<day>{'|'.join(f'{day[:3]}(?:{day[3:]})?' for day in WEEKDAYS)})(?: +|$))?"
    rf"(?:{_CLOCK})?(?<=.)",
    re.ASCII,
)
_UNIT_NS = {
    name: ns
    for ns, names in (
        (SECOND_NS, "s sec secs second seconds"),
        (60 * SECOND_NS, "m min mins minute minutes"),
        (3600 * SECOND_NS, "h hour hours"),
        (DAY_NS, "d day days"),
        (7 * DAY_NS, "w week weeks"),
        (365 * DAY_NS, "y year years"),
    )
    for name in names.split()
}
_LENGTH = rf"(?P<count>\d{{1,12}}(?:\.\d{{1,9}})?) ?(?P<unit>{'|'.join(_UNIT_NS)})"
_DURATION = late_pattern(_LENGTH, re.ASCII)
_AGO = late_pattern(rf"{_LENGTH} +ago", re.ASCII)


def _last_before(end_ns: int, found: re.Match[str], tz: str) -> int:
    """Return the last time before an end at which clocks show a time, on a day of the week."""
    day, clock = _local(end_ns, tz).date(), found["clock"] or "00:00"
    if found["day"]:
        day -= timedelta(days=(day.weekday() - _weekday(found["day"])) % 7)
    at_ns = parse_instant(f"{day}T{clock}", tz=tz)
    if at_ns > end_ns:
        day -= timedelta(days=7 if found["day"] else 1)
        at_ns = parse_instant(f"{day}T{clock}", tz=tz)
    return at_ns


def _weekday(name: str) -> int:
    return [day[:3] for day in WEEKDAYS].index(name[:3])


@lru_cache(maxsize=64)
def _zone(tz: str) -> ZoneInfo:
    from zoneinfo import ZoneInfo

    return ZoneInfo(tz)


def _digits(value: float) -> str:
    """Return the number without exponent; for NaN and its like something that is no number."""
    from decimal import Decimal

    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > 2**64:
        return repr(value)[:60] if isinstance(value, (bool, float)) else type(value).__name__
    return format(Decimal(repr(value)), "f")


def _instant_of_number(text: str) -> int:
    found = _NUMBER.fullmatch(text)
    if found is None:
        raise MomentError(
            f"Expected @ and the seconds or nanoseconds since 1970, got {text[:60]!r}."
        )
    digits = len(str(int(found["whole"])))
    if digits >= NANOSECONDS_DIGITS:
        return _checked(int(found["whole"]), f"@{text}")
    if digits > SECONDS_DIGITS:
        unit = next((name for those, name in _UNITS.items() if digits in those), "")
        raise MomentError(
            f"'@{text}': expected the seconds since 1970, of at most {SECONDS_DIGITS} digits, or "
            f"the nanoseconds, of {NANOSECONDS_DIGITS} or 19; got {digits} digits"
            + (f" ({unit}?)." if unit else ".")
        )
    return _checked(_decimal_ns(text, SECOND_NS), f"@{text}")


def _decimal_ns(text: str, unit_ns: int) -> int:
    """Return a decimal number of units in nanoseconds, rounded down: exact, unlike a float."""
    whole, _, fraction = text.partition(".")
    return int(whole) * unit_ns + int(f"0{fraction}") * unit_ns // int(f"1{'0' * len(fraction)}")


def _seconds(found: re.Match[str], tz: str) -> tuple[int, int]:
    """Return the whole seconds since the epoch that an ISO text names, first and second."""
    year, month, day, hour, minute, second = (
        int(found[part] or 0) for part in ("year", "month", "day", "hour", "minute", "second")
    )
    wall = datetime(year, month, day, hour, minute, second)  # noqa: DTZ001 - the offset comes next
    since_epoch = wall - _NAIVE_EPOCH
    seconds = since_epoch.days * 86_400 + since_epoch.seconds
    if found["offset"]:
        offset_s = _offset_s(found["offset"])
        return seconds - offset_s, seconds - offset_s
    first_s, second_s = wall_offsets_s(wall, tz)
    return seconds - first_s, seconds - second_s


def wall_offsets_s(wall: datetime, tz: str) -> tuple[int, int]:
    """Return how far a wall clock that shows `wall` is ahead of UTC, seconds.

    Two different values in the hour that comes twice: of its first and of its second coming.

    Raises:
        MomentError: The zone's clocks skip that time.
    """
    early = wall.replace(tzinfo=zone(tz), fold=0)
    before, after = early.utcoffset(), early.replace(fold=1).utcoffset()
    assert before is not None
    assert after is not None
    if before < after:
        raise MomentError(
            f"{wall.isoformat()}: the clocks of {tz} skip this hour; "
            "expected a time that exists, or one with an offset."
        )
    return before.days * 86_400 + before.seconds, after.days * 86_400 + after.seconds


def _offset_s(text: str) -> int:
    if text in "Zz":
        return 0
    digits = text[1:].replace(":", "").ljust(4, "0")
    hours, minutes = int(digits[:2]), int(digits[2:])
    if hours > 23 or minutes > 59:
        raise ValueError(f"expected an offset up to 23:59, got {text}")
    return (-1 if text[0] == "-" else 1) * (hours * 3600 + minutes * 60)


def _offset_text(local: datetime) -> str:
    text = f"{local:%z}"
    return f"{text[:3]}:{text[3:5]}"


def _comes_twice(local: datetime) -> bool:
    """Return whether another instant has the same wall-clock time."""
    return local.replace(fold=0).utcoffset() != local.replace(fold=1).utcoffset()


def _local(ns: int, tz: str) -> datetime:
    return (_EPOCH + timedelta(seconds=ns // SECOND_NS)).astimezone(zone(tz))


def _checked(ns: int, text: str) -> int:
    if not 0 <= ns <= MAX_TIME_NS:
        raise MomentError(f"{text!r}: expected a time from 1970 to 2262.")
    return ns


UNITS = ((DAY_NS, "d"), (3600 * SECOND_NS, "h"), (60 * SECOND_NS, "min"), (SECOND_NS, "s"))
"""Nanoseconds in a unit, and its name."""


def duration(ns: int) -> str:
    """Return a length of time in its largest unit and the next: `2 d 3 h`, `5 min`, `0.250 s`."""
    if ns < 10 * SECOND_NS:
        return f"{ns / SECOND_NS:.3f} s" if ns % SECOND_NS else f"{ns // SECOND_NS} s"
    place = next(i for i, (unit_ns, _) in enumerate(UNITS) if ns >= unit_ns)
    parts = []
    for unit_ns, name in UNITS[place : place + 2]:
        count, ns = divmod(ns, unit_ns)
        parts.append(f"{count} {name}" if count else "")
    return " ".join(filter(None, parts))


_LOCALTIME = Path("/etc/localtime")


def machine_zone() -> str:
    """Return the machine's IANA zone; UTC where it does not say."""
    named = os.environ.get("TZ", "").lstrip(":")
    try:
        target = str(_LOCALTIME.readlink())
    except OSError:
        target = ""
    linked = target.partition("zoneinfo/")[2]
    for name in (named, linked):
        if name:
            try:
                zone(name)
            except ValueError:
                continue
            return name
    return "UTC"


Time = int | str | date | np.datetime64 | Moment | None
"""Nanoseconds UTC, a text as on the command line (`2026-03-01T14:02`, `2h ago`, `event:12`), a
datetime, date or pandas Timestamp (without a zone it is in the log's), a numpy.datetime64 (UTC), or
what `moment` made of one."""


NUMBER_UNITS = {"seconds": 10**9, "milliseconds": 10**12, "microseconds": 10**15}
"""What a number may be of instead, from 2001 to 2286, from so many on to ten times as many."""


def moment_of(
    time: Time,
    *,
    tz: str,
    end_ns: Callable[[], int],
    last_ns: Callable[[], int] | None = None,
) -> Moment:
    """Return what a time means in a log.

    Args:
        time: A moment in any of its forms.
        tz: The log's zone.
        end_ns: Returns what `now` is, and `2h ago` counts from; called only where that matters.
        last_ns: Returns up to when `14:02` is the last one; default: `end_ns`.

    Raises:
        MomentError: It cannot be read.
    """
    if time is None:
        return Moment()
    if isinstance(time, Moment):
        return time
    if isinstance(time, date):
        time = time.isoformat()
    elif isinstance(time, np.datetime64):
        time = int(time.astype("datetime64[ns]").astype(np.int64))
    if isinstance(time, str):
        return parse_moment(time, tz=tz, end_ns=end_ns, last_ns=last_ns)
    if not is_whole_number(time):
        raise MomentError(
            f"expected a time as whole nanoseconds since 1970, a text such as {INSTANTS}, or a "
            f"datetime; got {time!r}."
        )
    return Moment(ns=int(time))


def check_time_unit(time: int, first_ns: Callable[[], int | None]) -> None:
    """Refuse a number that would be in January 1970 as nanoseconds, in a log that begins later.

    Args:
        time: Nanoseconds.
        first_ns: Returns when the log begins; called only for a number of that time.

    Raises:
        MomentError: It is one, and says which unit it may be of.
    """
    for unit, least in NUMBER_UNITS.items():
        if least <= time < 10 * least and (first_ns() or 0) > 100 * NUMBER_UNITS["microseconds"]:
            factor = 10**18 // least
            raise MomentError(
                f"expected a time as whole nanoseconds since 1970, got {time}, which looks like "
                f"{unit}; multiply by {factor:_}."
            )


def happened_ns_of(time: Time, *, tz: str, now_ns: int) -> int | None:
    """Return the happened time that a caller gives; None: none is given.

    Args:
        time: A moment in any of its forms, but for the number of an event.
        tz: The log's zone.
        now_ns: What `now` is, and `2h ago` counts from.

    Raises:
        MomentError: It cannot be read, or is the number of an event.
    """
    moment = moment_of(time, tz=tz, end_ns=lambda: now_ns)
    if moment.event is not None:
        raise MomentError(
            f"expected when it happened, a time such as {INSTANTS}; got the number of event "
            f"{moment.event}; `show` prints its time."
        )
    return moment.ns


NEAR_NS = 10 * 60 * SECOND_NS
"""What happened so long before or after a moment is near it."""
