"""Case: many logs asked at once, on this machine's cores, on disk and in a store.

The store is moto's server beside us, which is Python, and takes a core.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from functools import partial
from multiprocessing.process import current_process
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from steady_clock import SteadyClock

from benchmark.bucket import NAME, served_bucket
from benchmark.case import Case, Peer, Work
from benchmark.logs import Workshop
from benchmark.peers import OURS

LOGS, EVENTS_A_LOG, DOORS, DAYS = 100, 5_000, 20, 7
TRIED_OUT = 25
"""A run that only tries out has that part of the logs."""
ROUNDS = 3
HOUR_NS = 3600 * 10**9
START_NS = 1_772_409_600 * 10**9
"""2026-03-02T00:00Z."""
CLOSED, OPEN = 2, 1

Sightings = list[tuple[int, int, int]]
"""Time, nanoseconds; door; state."""


def fleet_cases(shop: Workshop, rounds: int | None, *, tries_out: bool = False) -> Iterator[Case]:
    """Yield: the doors of all logs at their ends, and all openings by hour."""
    logs = LOGS // (TRIED_OUT if tries_out else 1)
    shop.say(f"making {logs} logs")
    folder, kept = shop.folder / "fleet", shop.folder / "kept"
    folder.mkdir()
    seen = [_make(folder / f"robot{n:03}", n) for n in range(logs)]
    expected = _plain_answer(seen)
    events = sum(map(len, seen))
    try:
        with served_bucket() as named, patch.dict(os.environ, named):  # children inherit it
            url = f"s3://{NAME}/fleet"
            _ship_all(folder, url)
            peers = (
                Peer(OURS, partial(_ask, str(folder), "dask", kept), expected, units=events),
                Peer(f"{OURS}, moto", partial(_ask, url, "dask", kept), expected, units=events),
                Peer("one by one", partial(_ask, str(folder), "serial", kept), expected,
                     units=events),
            )  # fmt: skip
            yield Case("fleet", f"A fleet's map and openings, {logs} logs", "events/s", peers,
                       rounds or ROUNDS, has_memory=False)  # fmt: skip
    except ModuleNotFoundError as error:
        peer = Peer(OURS, partial(_missing, str(error.name)), None)
        yield Case("fleet", "A fleet's map and openings", "events/s", (peer,), 1)


def _make(folder: Path, seed: int) -> Sightings:
    """Make a log of a week, a commit an hour; return what was seen."""
    import semmap_log as sl
    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.model.events import DoorObserved

    rng, clock = np.random.default_rng(seed), SteadyClock(START_NS)
    count = EVENTS_A_LOG // (DAYS * 14)
    seen: Sightings = []
    with sl.create(folder, tz="UTC", clock=clock, compact=False, durability="none") as log:
        doors = [
            log.add_door(x=float(n), y=0.0, theta=0.0, width=0.9, state="closed", at=START_NS)
            for n in range(DOORS)
        ]
        for hour in (day * 24 + hour for day in range(DAYS) for hour in range(6, 20)):
            begins = START_NS + hour * HOUR_NS
            times = np.sort(rng.choice(HOUR_NS // 1000, count, replace=False)) * 1000 + begins
            door = rng.choice(doors, count)
            state = rng.choice([OPEN, CLOSED], count).astype(np.uint8)
            clock.now_ns = begins + HOUR_NS
            log.append(EventBatch.of(DoorObserved, door_id=door, state=state, happened_ns=times))
            seen += zip(times.tolist(), door.tolist(), state.tolist(), strict=True)
    return seen


def _plain_answer(fleet: list[Sightings]) -> tuple[Any, Any]:
    """Return the answer by loops over what was seen."""
    last: dict[tuple[int, int], int] = {}
    openings: Counter[tuple[int, int, int]] = Counter()
    for log, seen in enumerate(fleet):
        for time_ns, door, state in seen:
            if state == OPEN and last.get((log, door), CLOSED) == CLOSED:
                openings[log, door, time_ns // HOUR_NS] += 1
            last[log, door] = state
    names = {OPEN: "OPEN", CLOSED: "CLOSED"}
    states = {key: names[state] for key, state in last.items()}
    return states, dict(openings)


def _ship_all(folder: Path, url: str) -> None:
    from semmap_log.core.io.url_path import UrlPath
    from semmap_log.fleet.shipping import ship

    for log in sorted(folder.iterdir()):
        ship(log, UrlPath(f"{url}/{log.name}"))


def _ask(place: str, engine: str, kept: Path) -> Work:
    import semmap_log as sl

    current_process()._config["daemon"] = False  # noqa: SLF001  # or it may start no workers
    fleet = sl.fleet(place, engine=engine, fresh=True, results=kept)
    fleet.__enter__()

    def once(_: None) -> Any:
        return fleet.map(), fleet.openings()

    return Work(once, answer=partial(_as_plain, fleet.places))


def _as_plain(places: tuple[str, ...], found: Any) -> tuple[Any, Any]:
    number = {place: n for n, place in enumerate(places)}
    states, openings = (each.table.to_pydict() for each in found)
    hours = [int(hour.timestamp()) // 3600 for hour in openings["hour"]]
    logs = [number[log] for log in openings["log"]]
    return (
        {
            (number[log], door): state
            for log, door, state in zip(
                states["log"], states["door_id"], states["state"], strict=True
            )
        },
        dict(zip(zip(logs, openings["door_id"], hours, strict=True), openings["openings"],
                 strict=True)),
    )  # fmt: skip


def _missing(name: str) -> Work:
    raise ModuleNotFoundError(name=name)
