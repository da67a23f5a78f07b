"""Superseded objects removed: only they, whoever ships, reads, or is cut off meanwhile."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogAccessError, LogError
from semmap_log.fleet import shipping
from semmap_log.fleet.removing import Removed, remove_superseded
from semmap_log.fleet.shipping import ship
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.byte_layout import MANIFEST_NAME
from semmap_log.store.compaction import compact
from semmap_log.store.manifest import KeptManifest, read_manifest
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import ObjectSegments
from tests.fleet.test_shipping import CountedStore, a_log, events_of
from tests.verbs import ran

DAY_NS = 86_400 * 10**9


def kept_at(url: str) -> KeptManifest:
    kept = read_manifest(ObjectStore(UrlPath(url)))
    assert kept is not None
    return kept


def segments_at(url: str) -> set[str]:
    listed = ObjectStore(UrlPath(url)).list()
    return {one.name for one in listed if one.name.endswith(".mcap")}


def named_at(url: str) -> set[str]:
    return {one.name for one in kept_at(url).manifest.segments}


def removed_at(place: str | ObjectStore, days: float = 0.0) -> Removed:
    store = ObjectStore(UrlPath(place)) if isinstance(place, str) else place
    log_id = kept_at(str(store.url)).manifest.info.log_id
    return remove_superseded(store, log_id, int(days * DAY_NS))


def pages_of(reader: LogReader) -> list[bytes]:
    return [bytes(page.data) for _, page in reader.pages()]


@pytest.fixture
def both(bucket: str, tmp_path: Path) -> tuple[Path, Path]:
    """Two copies of a log, one of them compacted; both were shipped, the compacted one last."""
    log = a_log(tmp_path / "log", 3)
    other = shutil.copytree(log, tmp_path / "other")
    ship(log, UrlPath(bucket))
    compact(log)
    ship(log, UrlPath(bucket))
    return log, other


def test_what_was_replaced_is_removed_and_nothing_else(
    bucket: str, both: tuple[Path, Path]
) -> None:
    """An object that was put, and that no manifest has named yet, is somebody's upload."""
    store = ObjectStore(UrlPath(bucket))
    superseded = segments_at(bucket) - named_at(bucket)
    uploaded = "000009-0123456789abcdef.mcap"
    store.create(uploaded, b"on its way")

    done = removed_at(bucket)

    assert done.objects == len(superseded) > 0
    assert segments_at(bucket) == named_at(bucket) | {uploaded}
    assert kept_at(bucket).manifest.superseded == ()
    assert verify(UrlPath(bucket)).exit_code == 0
    assert events_of(both[0]) == events_of(bucket)
    version = kept_at(bucket).manifest.version
    assert removed_at(bucket) == Removed()
    assert kept_at(bucket).manifest.version == version


def test_it_counts_from_the_manifest_that_dropped_it_by_the_stores_clock(
    bucket: str, both: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot's clock that is years ahead removes nothing early."""
    before = kept_at(bucket)
    assert {one.since_ns for one in before.manifest.superseded} == {None}
    again = kept_at(bucket)
    wall_ns = time.time_ns()
    monkeypatch.setattr(time, "time_ns", lambda: wall_ns + 3650 * DAY_NS)

    done = removed_at(bucket, days=7)

    assert (0, len(before.manifest.superseded)) == (done.objects, done.left)
    ship(both[1], UrlPath(bucket))  # another manifest: the time is written down
    since = {one.since_ns for one in kept_at(bucket).manifest.superseded}
    assert since <= {again.modified_ns, None}
    assert segments_at(bucket) > named_at(bucket)


def test_younger_ones_stay(bucket: str, both: tuple[Path, Path]) -> None:
    kept = kept_at(bucket)
    first, *rest = kept.manifest.superseded
    old = [kept.modified_ns - 10 * DAY_NS, kept.modified_ns - 3 * DAY_NS]
    aged = (replace(first, since_ns=old[0]), *(replace(one, since_ns=old[1]) for one in rest))
    manifest = replace(kept.manifest, superseded=aged)
    ObjectStore(UrlPath(bucket)).replace(MANIFEST_NAME, manifest.text().encode(), kept.e_tag)

    done = removed_at(bucket, days=7)

    assert (1, len(rest)) == (done.objects, done.left)
    assert segments_at(bucket) == named_at(bucket) | {one.name for one in rest}


def test_a_name_that_is_no_segments_is_never_removed(bucket: str, both: tuple[Path, Path]) -> None:
    """Whatever a manifest lists: what it names itself, and what a shipping never called so."""
    kept = kept_at(bucket)
    store = ObjectStore(UrlPath(bucket))
    store.create("notes.mcap", b"mine")
    first = kept.manifest.superseded[0]
    named = kept.manifest.segments[0]
    listed = (
        replace(first, name="notes.mcap", since_ns=0),
        replace(first, name=named.name, since_ns=0),
    )
    text = replace(kept.manifest, superseded=listed).text()
    store.replace(MANIFEST_NAME, text.encode(), kept.e_tag)

    assert removed_at(bucket).objects == 0
    assert {"notes.mcap", named.name} <= segments_at(bucket)


def test_a_reader_that_holds_the_old_manifest_is_told_and_reads_on(
    bucket: str, tmp_path: Path
) -> None:
    log = a_log(tmp_path / "log", 3)
    ship(log, UrlPath(bucket))
    opened = LogReader(ObjectSegments(ObjectStore(UrlPath(bucket)), listed_for_s=0.0))
    last = opened.last_event()
    compact(log)
    ship(log, UrlPath(bucket))
    assert opened.event(last - 500).number == last - 500  # the old objects stay

    removed_at(bucket)

    with pytest.raises(LogError, match=r"gone|no such|reopen"):
        pages_of(opened)
    opened.refresh()
    assert opened.event(3).number == 3
    assert opened.last_event() == last


class WithRivalStore(ObjectStore):
    """Lets a rival do something before each change, once or each time."""

    def __init__(self, url: UrlPath, before: dict[str, Callable[[], None]]) -> None:
        super().__init__(url)
        self.before = before

    def _first(self, what: str) -> None:
        rival = self.before.pop(what, None)
        if rival is not None:
            rival()

    def replace(self, name, data, e_tag):  # type: ignore[no-untyped-def]
        if name == MANIFEST_NAME:  # not the probe
            self._first("replace")
        return super().replace(name, data, e_tag)

    def remove(self, name):  # type: ignore[no-untyped-def]
        if name.endswith(".mcap"):
            self._first("remove")
        super().remove(name)


@pytest.mark.parametrize("when", ["replace", "remove"])
def test_a_rival_that_still_has_the_old_segments_ships_in_the_middle(
    bucket: str, both: tuple[Path, Path], when: str
) -> None:
    """Before the new generation, or before the first object goes."""
    rival = {when: lambda: void(ship(both[1], UrlPath(bucket)))}

    removed_at(WithRivalStore(UrlPath(bucket), rival))

    assert named_at(bucket) <= segments_at(bucket)
    assert verify(UrlPath(bucket)).exit_code == 0
    assert events_of(both[1]) == events_of(bucket)


def test_a_rival_that_has_found_the_old_segments_there_sends_them_again(
    bucket: str, both: tuple[Path, Path]
) -> None:
    """They were removed between its look, and its manifest: that is refused, and it looks anew."""
    rival = {"replace": lambda: void(removed_at(bucket))}

    done = ship(both[1], WithRivalStore(UrlPath(bucket), rival))

    assert done.sent == len(done.manifest.segments)
    assert named_at(bucket) <= segments_at(bucket)
    assert verify(UrlPath(bucket)).exit_code == 0


def test_a_list_of_superseded_objects_is_bounded(
    bucket: str, both: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that were superseded last are kept."""
    monkeypatch.setattr(shipping, "MOST_SUPERSEDED", 2)
    ship(both[1], UrlPath(bucket))
    dropped = [one.name for one in kept_at(bucket).manifest.segments]

    ship(both[0], UrlPath(bucket))

    listed = [one.name for one in kept_at(bucket).manifest.superseded]
    assert (3, dropped[-2:]) == (len(dropped), listed)


def test_two_that_remove_at_once(bucket: str, both: tuple[Path, Path]) -> None:
    for when in ("replace", "remove"):
        removed_at(WithRivalStore(UrlPath(bucket), {when: lambda: void(removed_at(bucket))}))

    assert segments_at(bucket) == named_at(bucket)
    assert kept_at(bucket).manifest.superseded == ()


def test_cut_at_each_request_and_begun_again(bucket: str, both: tuple[Path, Path]) -> None:
    log, other = both
    whole = CountedStore(UrlPath(bucket))
    removed_at(whole)
    for until in range(whole.asked):
        for copy in (other, log):
            ship(copy, UrlPath(bucket))

        with pytest.raises(LogAccessError, match="cable"):
            removed_at(CountedStore(UrlPath(bucket), until=until))

        assert verify(UrlPath(bucket)).exit_code == 0
        removed_at(bucket)
        assert segments_at(bucket) == named_at(bucket)


class KeepingStore(ObjectStore):
    """Lets nobody remove, as a robot's key may be."""

    def remove(self, name):  # type: ignore[no-untyped-def]
        raise LogAccessError(f"{self.url / name}: the store refuses: 403.")


def test_who_may_not_remove_is_told_and_nothing_is_changed(
    bucket: str, both: tuple[Path, Path]
) -> None:
    before, there = kept_at(bucket), segments_at(bucket)

    with pytest.raises(LogAccessError, match="403"):
        removed_at(KeepingStore(UrlPath(bucket)))

    assert (before, there) == (kept_at(bucket), segments_at(bucket))


def test_the_verb_removes(
    bucket: str, both: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    there = len(segments_at(bucket) - named_at(bucket))
    words = ("ship", str(both[0]), bucket, "--remove-superseded-after")

    code, out, _ = ran(capsys, *words, "7")
    assert (0, False) == (code, "removed" in out)
    code, out, _ = ran(capsys, *words, "0")
    assert (0, True) == (code, f"{there} superseded objects removed there" in out)
    assert ran(capsys, *words, "nan")[0] == ran(capsys, *words, "-1")[0] == 2


def void(_: object) -> None:
    pass
