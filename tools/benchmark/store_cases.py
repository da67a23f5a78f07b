"""Cases: a log that lies in a store, planned and asked there, beside fetching it first.

The store is moto's server beside us, which is Python: read the bytes and the requests, not the
times.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any
from unittest.mock import patch

from benchmark.bucket import NAME, served_bucket
from benchmark.case import Case, Peer, Work
from benchmark.folding import commit_sizes
from benchmark.logs import ZSTD, BenchLog, Workshop
from benchmark.moments import CHECKED, moments
from benchmark.peers import OURS
from benchmark.plain_fold import answer_of, plain_answers

LARGE = 1_000_000
"""Below, segments are so small that they come whole."""
ROUNDS, BURST, BURST_S = 5, 5, 5.0
FETCHED = "fetched whole, then asked"


def store_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: planning, a moment of a log just opened, and the next moment."""
    per_commit = commit_sizes(count)[-1]
    log = shop.log(count, per_commit, ZSTD)
    try:
        import obstore  # noqa: F401

        with served_bucket() as named, patch.dict(os.environ, named):  # children inherit it
            url = f"s3://{NAME}/{count}"
            shop.say(f"shipping {count:,} events")
            _ship(log.path, url)
            yield from _cases(log, url, rounds or ROUNDS)
    except ModuleNotFoundError as error:
        peer = Peer(OURS, partial(_missing, str(error.name)), None)
        yield Case("store", "A log in a store", "ms", (peer,), 1)


def _cases(log: BenchLog, url: str, rounds: int) -> Iterator[Case]:
    options: dict[str, Any] = {
        "rounds": rounds, "burst": BURST, "burst_s": BURST_S, "events": log.count,
    }  # fmt: skip
    yield Case(
        "store", "In a store: planning", "ms",
        (Peer(OURS, partial(_plan, url), sum(log.chunks), store_bytes=log.bytes),),
        **options,
    )  # fmt: skip
    asked = moments(log.count)[:CHECKED]
    told = plain_answers(log.count, None, tuple(asked))
    expected = [told[at_ns] for at_ns in asked]
    share = "< 5 %" if log.count >= LARGE else ""
    for title, is_cold in (("a moment, just opened", True), ("the next moment", False)):
        ours = Peer(OURS, partial(_moment, url, log.count, is_cold=is_cold), expected,
                    store_bytes=log.bytes)  # fmt: skip
        whole = Peer(FETCHED, partial(_fetched, url, log.count), expected, store_bytes=log.bytes)
        yield Case("store", f"In a store: {title}", "ms", (ours, whole), share_promise=share,
                   **options)  # fmt: skip


def _ship(log: Path, url: str) -> None:
    from semmap_log.core.io.url_path import UrlPath
    from semmap_log.fleet.shipping import ship

    ship(log, UrlPath(url))


@dataclass(slots=True)
class _Counted:
    """What passed obstore's door."""

    requests: int = 0
    bytes: int = 0

    def watch(self) -> None:
        """Count from now on, in this process."""
        import obstore

        for name in ("get", "head", "list_with_delimiter"):
            setattr(obstore, name, partial(self._asked, getattr(obstore, name)))

    def _asked(self, request: Any, *arguments: Any, **options: Any) -> Any:
        result = request(*arguments, **options)
        self.requests += 1
        if hasattr(result, "range"):
            start, end = result.range
            self.bytes += end - start
        return result


def _plan(url: str) -> Work:
    import semmap_log as sl

    counted = _watched()
    turns: list[int] = []

    def once(_: None) -> sl.DoorLog:
        _forget()
        before = counted.requests
        log = sl.read(url)
        turns.append(counted.requests - before)
        return log

    return Work(
        once,
        answer=lambda log: sum(len(one.chunks) for one in log._reader.segments),  # noqa: SLF001  # what was opened
        note=lambda _: _requests(turns),
        read_bytes=lambda: counted.bytes,
    )


def _moment(url: str, count: int, *, is_cold: bool) -> Work:
    import semmap_log as sl

    counted = _watched()
    turns: list[int] = []
    log = sl.read(url)

    def at(at_ns: int) -> Any:
        if is_cold:
            return sl.read(url).replay(at_ns)
        return log.replay(at_ns)

    def once(at_ns: int) -> Any:
        before = counted.requests
        found = at(at_ns)
        turns.append(counted.requests - before)
        return found

    def inputs() -> Iterator[int]:
        for at_ns in cycle(moments(count)):
            if is_cold:
                _forget()
            yield at_ns

    return Work(
        once,
        inputs(),
        lambda _: [answer_of(at(at_ns)) for at_ns in moments(count)[:CHECKED]],
        lambda _: _requests(turns),
        lambda: counted.bytes,
    )


def _fetched(url: str, count: int) -> Work:
    """Return: every object copied to a disk, as `aws s3 cp --recursive` does, then asked there."""
    import obstore
    from obstore.store import from_url

    import semmap_log as sl

    counted = _watched()
    store = from_url(url, client_options={"allow_http": True})

    def at(at_ns: int) -> Any:
        with tempfile.TemporaryDirectory() as name:
            for each in obstore.list_with_delimiter(store)["objects"]:
                if each["path"].endswith(".mcap"):
                    data = bytes(obstore.get(store, each["path"]).bytes())
                    Path(name, each["path"]).write_bytes(data)
            return sl.read(name).replay(at_ns)

    return Work(
        at,
        cycle(moments(count)),
        lambda _: [answer_of(at(at_ns)) for at_ns in moments(count)[:CHECKED]],
        read_bytes=lambda: counted.bytes,
    )


def _requests(turns: list[int]) -> str:
    least, most = min(turns), max(turns)
    return f"requests: {least}" if least == most else f"requests: {least} to {most}"


def _watched() -> _Counted:
    counted = _Counted()
    counted.watch()
    return counted


def _forget() -> None:
    """Forget the blocks that this process has fetched."""
    from semmap_log.core.io import object_source

    object_source._kept.clear()  # noqa: SLF001  # as a process that has just begun


def _missing(name: str) -> Work:
    raise ModuleNotFoundError(name=name)
