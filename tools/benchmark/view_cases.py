"""The cases of the recording for rerun: how long a log takes to become one, and to be opened."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from benchmark.case import Case, Peer, Work
from benchmark.logs import Workshop
from benchmark.peers import OURS
from benchmark.rounds import Rounds
from benchmark.view_reading import States, states_in, states_of
from benchmark.view_rows import log_rows

SIZES = ((Rounds(100_000, 133), 4_000, 300), (Rounds(1_000_000, 500), 40_000, 400))
"""A log; how many ms it may take; how many MB of memory."""
TRIED_OUT = ((Rounds(300, 5), 4_000, 300), (Rounds(600, 10), 40_000, 400))
SLOW_EVENTS = 3_000
"""Rerun's own way, row by row, gets so many events from the log's beginning."""
MOMENTS = 5
OPENED_MS = 5_000
MB = 10**6


def view_cases(shop: Workshop, rounds: int | None, *, tries_out: bool = False) -> Iterator[Case]:
    """Yield: a log of 100,000 events into .rrd; one of a million; the viewer opening that.

    Args:
        shop: Where the logs are made.
        rounds: Rounds that count; None: one.
        tries_out: Only small logs, and no viewer, to see whether everything works.
    """
    recording = Path()
    for made, most_ms, most_mb in TRIED_OUT if tries_out else SIZES:
        folder = shop.folder_for(f"view_{made.events}")
        shop.say(f"writing {made.events:,} events of {made.doors} doors")
        made.write(folder / "log")
        recording = folder / "ours.rrd"
        yield _conversion(folder, made, most_ms, most_mb, rounds)
    if not tries_out:
        yield _opening(recording, shop.folder_for("view_none"), rounds)


def _conversion(folder: Path, made: Rounds, most_ms: int, most_mb: int, rounds: int | None) -> Case:
    few = min(SLOW_EVENTS, made.events)
    numbers = [made.doors + (made.events - 1 - made.doors) * i // MOMENTS
               for i in range(1, MOMENTS + 1)]  # fmt: skip
    log = folder / "log"
    peers = (
        Peer(OURS, partial(_ours, log, folder / "ours.rrd", numbers), states_of(log, numbers),
             promise=f"< {most_ms} ms"),
        Peer(f"rr.log, {few / made.events:.1%} of it",
             partial(_row_by_row, log, folder / "slow.rrd", few),
             states_of(log, [few - 1], timelines=["event"]), units=few / made.events),
    )  # fmt: skip
    title = f"{made.events:,} events of {made.doors} doors into .rrd"
    return Case("view", title, "ms", peers, rounds or 1, memory_mb=most_mb, warms_up=False)


def _ours(path: Path, rrd: Path, numbers: list[int]) -> Work:
    import semmap_log as sl
    from benchmark.view_reading import shape_of
    from semmap_log.views.rerun import blueprint, file  # noqa: F401 - loads rerun: not timed
    from semmap_log.views.rerun.recording import RrdSummary, save_rrd

    def answer(_: RrdSummary) -> States:
        return states_in(rrd, sl.read(path), numbers)

    def note(summary: RrdSummary) -> str:
        most, chunks = shape_of(rrd)
        return (f"{summary.bytes / MB:.1f} MB, {chunks:,} chunks of at most {most:,} rows, "
                f"{summary.left_out}")  # fmt: skip

    return Work(lambda _: save_rrd(sl.read(path), rrd), answer=answer, note=note)


def _row_by_row(path: Path, rrd: Path, count: int) -> Work:
    import semmap_log as sl

    def once(_: None) -> None:
        log_rows(sl.read(path), rrd, count)

    def answer(_: None) -> States:
        return states_in(rrd, sl.read(path), [count - 1], timelines=["event"])

    def note(_: None) -> str:
        return f"{rrd.stat().st_size / MB:.1f} MB for {count:,} events"

    return Work(once, answer=answer, note=note)


def _opening(recording: Path, folder: Path, rounds: int | None) -> Case:
    peers = (
        Peer(OURS, partial(_opened, recording), True, promise=f"< {OPENED_MS} ms"),
        Peer("a recording of one door", partial(_opened_small, folder / "door"), True),
    )  # fmt: skip
    return Case("view", "Rerun's viewer starts and opens it", "ms", peers, rounds or 3,
                has_memory=False)  # fmt: skip


def _opened(recording: Path) -> Work:
    from semmap_log.views.rerun.viewer import ViewerError, headless

    def once(_: None) -> bool:
        with headless(recording) as viewer:
            return not any(view.reports for view in viewer.state().views)

    try:
        once(None)
    except ViewerError as error:
        if "graphics driver" in str(error):
            raise ModuleNotFoundError(name="a graphics driver") from None
        raise
    return Work(once)


def _opened_small(folder: Path) -> Work:
    import semmap_log as sl
    from semmap_log.views.rerun.recording import save_rrd

    with sl.create(folder, tz="UTC") as log:
        log.add_door()
    recording = folder.with_suffix(".rrd")
    save_rrd(sl.read(folder), recording)
    return _opened(recording)
