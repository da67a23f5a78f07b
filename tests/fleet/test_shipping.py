"""Logs sent to a bucket: once, whole, refused where they went another way, whatever is cut."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import CorruptLogError, LogAccessError, LogError
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.shipping import check_conditions, ship
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import ObjectSegments
from tests.verbs import ran

RECORDINGS = Path(__file__).parents[2] / "recordings"


class CountedStore(ObjectStore):
    """Counts what is asked, and stops answering when told."""

    def __init__(self, url: UrlPath, *, until: float = float("inf")) -> None:
        super().__init__(url)
        self.asked = 0
        self.until = until

    def _asked(self, name, request):  # type: ignore[no-untyped-def]
        if hasattr(self, "asked"):  # not while it is made
            self.asked += 1
            if self.asked > self.until:
                raise LogAccessError(f"{self.url / name}: the cable was cut.")
        return super()._asked(name, request)


def a_log(path: Path, sessions: int = 4) -> Path:
    """Make a log of several segments, which recordings of hours are."""
    with sl.create(path, tz="UTC", compact=False) as log:
        door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front")
    for number in range(sessions):
        with sl.append(path, compact=False) as log:
            for _ in range(400):
                log.observe(door, "open" if number % 2 else "closed", reason="x" * 3000)
    return path


def events_of(place: Path | str) -> list[str]:
    return [repr(event) for batch in sl.read(place).batches_in() for event in batch]


def test_a_shipped_log_answers_as_the_one_on_the_disk(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log")

    done = ship(log, UrlPath(bucket))

    assert done.sent == len(list(log.glob("*.mcap"))) > 1
    assert events_of(log) == events_of(bucket)
    assert repr(sl.read(log).replay().doors) == repr(sl.read(bucket).replay().doors)
    found = verify(UrlPath(bucket))
    assert (verify(log).head, ()) == (found.head, found.findings)
    assert found.head == done.manifest.segments[-1].head


def test_shipped_again_nothing_is_sent(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log")
    ship(log, UrlPath(bucket))
    store = CountedStore(UrlPath(bucket))

    again = ship(log, store)

    assert (0, False, 1, 1) == (again.sent, again.is_new, again.manifest.version, store.asked)


def test_cut_at_each_request_and_begun_again_nothing_is_lost_or_sent_twice(
    bucket: str, tmp_path: Path
) -> None:
    log = a_log(tmp_path / "log")
    segments = len(list(log.glob("*.mcap")))
    whole = CountedStore(UrlPath(f"{bucket}/whole"))
    ship(log, whole)
    for until in range(whole.asked):
        url = UrlPath(f"{bucket}/cut{until}")
        with pytest.raises(LogAccessError, match="cable"):
            ship(log, CountedStore(url, until=until))
        there = [one for one in ObjectStore(url).list() if one.name.endswith(".mcap")]

        done = ship(log, url)

        assert done.sent == segments - len(there)
        assert verify(url).exit_code == 0
    assert events_of(log) == events_of(str(url))


def test_one_request_plans_a_log(bucket: str, tmp_path: Path) -> None:
    """The manifest: who then asks for an event reads the ends of one segment, and a chunk of it."""
    log = a_log(tmp_path / "log")
    ship(log, UrlPath(bucket))
    store = CountedStore(UrlPath(bucket))

    reader = LogReader(ObjectSegments(store))
    planned = store.asked
    reader.event(700)

    assert (1, True) == (planned, store.asked <= 6)


def test_a_log_that_goes_on_is_shipped_on(bucket: str, tmp_path: Path) -> None:
    """Also where its last segment was small, and the next writer continued it in a copy."""
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9)
    ship(tmp_path / "log", UrlPath(bucket))
    opened = LogReader(ObjectSegments(ObjectStore(UrlPath(bucket)), listed_for_s=0.0))
    before = opened.last_event()
    with sl.append(tmp_path / "log", compact=False) as log:
        log.observe(door, "open")

    done = ship(tmp_path / "log", UrlPath(bucket))
    opened.refresh()

    assert (1, 2) == (done.sent, done.manifest.version)
    assert before + 1 == opened.last_event()
    assert events_of(tmp_path / "log") == events_of(bucket)


def test_a_compacted_log_replaces_what_was_shipped(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log")
    ship(log, UrlPath(bucket))
    compact(log, keep_s=0)

    done = ship(log, UrlPath(bucket))

    assert (True, len(list(log.glob("*.mcap")))) == (done.is_new, len(done.manifest.segments))
    assert events_of(log) == events_of(bucket)
    assert verify(UrlPath(bucket)).exit_code == 0


def _fork(log: Path, other: Path) -> None:
    for path in (log, other):
        with sl.append(path, compact=False) as writer:
            writer.add_door(x=3.0, y=2.0, theta=0.0, width=0.9)


def _put_back(log: Path, other: Path) -> None:
    with sl.append(log, compact=False) as writer:
        writer.add_door(x=3.0, y=2.0, theta=0.0, width=0.9)


@pytest.mark.parametrize(
    ("way", "said"), [(_fork, "continued on two machines"), (_put_back, "was put back")]
)
def test_a_log_that_went_another_way_is_refused(
    bucket: str, tmp_path: Path, way: Callable[[Path, Path], None], said: str
) -> None:
    log = a_log(tmp_path / "log", 1)
    other = shutil.copytree(log, tmp_path / "other")
    way(log, other)
    ship(log, UrlPath(bucket))

    with pytest.raises(LogError, match=said):
        ship(other, UrlPath(bucket))

    assert events_of(log) == events_of(bucket)


def test_another_log_is_not_written_over(bucket: str, tmp_path: Path) -> None:
    ship(RECORDINGS / "office", UrlPath(bucket))

    with pytest.raises(LogError, match="got another one"):
        ship(RECORDINGS / "clinic_week", UrlPath(bucket))


def test_sixteen_that_ship_at_once_leave_the_whole_log(bucket: str, tmp_path: Path) -> None:
    """Half of them an older copy: whoever comes late refuses, or finds all there."""
    old = a_log(tmp_path / "old", 1)
    log = shutil.copytree(old, tmp_path / "log")
    with sl.append(log, compact=False) as writer:
        writer.add_door(x=3.0, y=2.0, theta=0.0, width=0.9)

    def shipped(number: int) -> str:
        try:
            ship(log if number % 2 else old, UrlPath(bucket))
        except LogError as error:
            return str(error)
        return ""

    with ThreadPoolExecutor(16) as pool:
        said = list(pool.map(shipped, range(16)))

    assert all("put back" in each for each in said if each)
    assert not any(said[1::2])
    assert events_of(log) == events_of(bucket)


def test_a_live_segment_waits(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log", 1)
    with sl.append(log, compact=False) as writer:
        writer.add_door(x=3.0, y=2.0, theta=0.0, width=0.9)
        done = ship(log, UrlPath(bucket))

        assert done.waits_events > 0
        assert sl.read(bucket).replay().doors.keys() == {1}


class NotedStore(ObjectStore):
    """Takes note of what a segment is handed over as."""

    kinds: set[type] = set()  # noqa: RUF012

    def create(self, name, data):  # type: ignore[no-untyped-def]
        if name.endswith(".mcap"):
            self.kinds = self.kinds | {type(data)}
        return super().create(name, data)


def test_a_segment_is_handed_over_as_it_was_read(bucket: str, tmp_path: Path) -> None:
    """A store that honours conditions takes an object in one request."""
    log = a_log(tmp_path / "log", 1)
    store = NotedStore(UrlPath(bucket))

    ship(log, store)

    assert store.kinds == {memoryview}
    assert events_of(log) == events_of(bucket)


class ForgetfulStore(ObjectStore):
    """Overwrites what is there, whatever the condition says: as rclone's S3 server does."""

    def create(self, name, data):  # type: ignore[no-untyped-def]
        self._obstore.put(self._store, name, data)
        return True


def test_a_store_that_ignores_conditions_is_refused(bucket: str, tmp_path: Path) -> None:
    with pytest.raises(LogError, match="ignores the condition"):
        ship(RECORDINGS / "office", ForgetfulStore(UrlPath(bucket)))
    check_conditions(ObjectStore(UrlPath(bucket)))


def _altered(store: ObjectStore, one: ObjectStatus) -> None:
    got = store.whole(one.name, most_bytes=2**24)
    assert got is not None
    data = bytearray(got[0])
    data[data.rindex(b"semmap_index") - 300] ^= 1  # in its last chunk
    store.remove(one.name)
    store.create(one.name, bytes(data))


def _removed(store: ObjectStore, one: ObjectStatus) -> None:
    store.remove(one.name)


def _cut(store: ObjectStore, one: ObjectStatus) -> None:
    got = store.whole(one.name, most_bytes=2**24)
    assert got is not None
    store.remove(one.name)
    store.create(one.name, got[0][:-1000])


@pytest.mark.parametrize("harm", [_altered, _removed, _cut])
@pytest.mark.parametrize("which", [0, 2, -1])
def test_a_harmed_object_is_never_an_answer(
    bucket: str, tmp_path: Path, harm: Callable[[ObjectStore, ObjectStatus], None], which: int
) -> None:
    """Neither of a question that reads it, nor of `verify`, nor of `fetch`."""
    log = a_log(tmp_path / "log")
    ship(log, UrlPath(bucket))
    store = ObjectStore(UrlPath(bucket))
    segments = [one for one in store.list() if one.name.endswith(".mcap")]
    harm(store, segments[which])

    with pytest.raises(LogError):
        events_of(bucket)
    assert verify(UrlPath(bucket)).exit_code == 4
    with pytest.raises(LogError):
        fetch(UrlPath(bucket), tmp_path / "fetched")
    assert not list(tmp_path.glob("fetched*"))


def test_a_manifest_that_was_written_by_hand_is_damage(bucket: str, tmp_path: Path) -> None:
    ship(RECORDINGS / "office", UrlPath(bucket))
    store = ObjectStore(UrlPath(bucket))
    got = store.whole("manifest.json", most_bytes=2**24)
    assert got is not None
    store.replace("manifest.json", got[0].replace(b'"version": 1', b'"version": 7'), got[1].e_tag)

    with pytest.raises(CorruptLogError, match="no manifest as it was written"):
        sl.read(bucket)


def test_fetched_it_is_the_same_log_and_goes_on(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log")
    ship(log, UrlPath(bucket))

    (tmp_path / "back.part").mkdir()
    (tmp_path / "back.part" / "mine.txt").write_text("kept")

    fetch(UrlPath(bucket), tmp_path / "back")

    assert events_of(log) == events_of(tmp_path / "back")
    verified = verify(tmp_path / "back")
    assert (verified.exit_code, verified.findings) == (0, ())
    assert (tmp_path / "back.part" / "mine.txt").read_text() == "kept"
    with sl.append(tmp_path / "back") as writer:
        writer.add_door(x=3.0, y=2.0, theta=0.0, width=0.9)
    assert ship(tmp_path / "back", UrlPath(bucket)).manifest.version == 2


def test_the_verbs(bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = a_log(tmp_path / "log", 1)

    code, out, _ = ran(capsys, "ship", str(log), bucket)
    assert (0, True) == (code, "sent 1 segment," in out)
    code, out, _ = ran(capsys, "ship", str(log), bucket)
    assert (0, True) == (code, "nothing to send" in out)
    code, _, said = ran(capsys, "info", bucket)
    assert (0, True) == (code, f"semmap-log verify {bucket} --head" in said)
    code, out, _ = ran(capsys, "fetch", bucket, str(tmp_path / "back"))
    assert (0, True) == (code, " in 1 segment, " in out)
    code, _, said = ran(capsys, "fetch", bucket, str(tmp_path / "back"))
    assert (1, True) == (code, "exists" in said)
    code, _, said = ran(capsys, "ship", str(log), "office")
    assert (2, True) == (code, "expected a URL" in said)
