"""Whole milliseconds, and a zone's offsets."""

from __future__ import annotations

from datetime import datetime, timezone

from semmap_log.core.model.moments import zone
from semmap_log.views.zone_times import Span, first_ms, from_utc, zone_offsets


def test_what_counts_from_a_nanosecond_on_counts_from_the_next_millisecond_on() -> None:
    """Never before, and at a whole one at once."""
    assert [0, 1, 1, 2] == [first_ms(ns) for ns in (0, 1, 10**6, 10**6 + 1)]


def test_the_clocks_change_at_the_right_millisecond() -> None:
    """Vienna in 2026: on 29 March and on 25 October, at one o'clock UTC."""
    begin, end, spring, autumn = (
        int(datetime(2026, month, day, hour, tzinfo=timezone.utc).timestamp() * 1000)
        for month, day, hour in [(1, 1, 0), (12, 31, 0), (3, 29, 1), (10, 25, 1)]
    )

    found = zone_offsets(Span(begin, end), "Europe/Vienna")

    assert [(begin, 3600), (spring, 7200), (autumn, 3600)] == found


def test_an_offset_in_words() -> None:
    """Minutes where there are any."""
    shown = [from_utc(round(hours * 3600)) for hours in (0, 1, -3.5, 5.75, -10)]

    assert ["UTC", "UTC+1", "UTC-3:30", "UTC+5:45", "UTC-10"] == shown


def test_a_moment_has_one_offset() -> None:
    """That of its place."""
    offset = datetime(2026, 7, 1, tzinfo=zone("Asia/Kathmandu")).utcoffset()

    assert offset is not None
    assert [(1_782_000_000_000, offset.seconds)] == zone_offsets(
        Span(1_782_000_000_000, 1_782_000_000_000), "Asia/Kathmandu"
    )
