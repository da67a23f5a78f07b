"""What a shipping would do: told before, true after, and nothing written meanwhile."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogAccessError, LogError
from semmap_log.fleet.keeping import ObjectCount, check_shipping
from semmap_log.fleet.shipping import ship
from semmap_log.store.compaction import compact
from tests.fleet.test_shipping import CountedStore, ForgetfulStore, a_log, events_of
from tests.verbs import ran


def names_at(url: str) -> dict[str, str]:
    return {one.name: one.e_tag for one in ObjectStore(UrlPath(url)).list()}


def test_what_is_told_is_what_is_sent(bucket: str, tmp_path: Path) -> None:
    """Of a log that was never shipped, of one that went on, and of one that was compacted."""
    log = a_log(tmp_path / "log", 2)
    for change in (lambda: None, lambda: a_session(log), lambda: compact(log)):
        change()
        before = names_at(bucket)

        told = check_shipping(log, UrlPath(bucket))

        assert (before, 1) == (names_at(bucket), told.exit_code)
        done = ship(log, UrlPath(bucket))
        assert ObjectCount(done.sent, done.sent_bytes) == told.to_send
        assert check_shipping(log, UrlPath(bucket)).exit_code == 0
    superseded = check_shipping(log, UrlPath(bucket)).superseded
    named = {one.name for one in done.manifest.segments}
    left = [one.size for one in ObjectStore(UrlPath(bucket)).list() if one.name not in named]
    assert superseded is not None
    assert superseded.number == len(left) - 1 > 0  # beside the manifest


def a_session(log: Path) -> None:
    with sl.append(log, compact=False) as writer:
        writer.observe("front", "open")


def test_with_nothing_to_send_nothing_is_put_not_even_a_probe(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log", 1)
    ship(log, UrlPath(bucket))
    store = CountedStore(UrlPath(bucket))

    told = check_shipping(log, store)

    assert (0, False, 2) == (told.exit_code, told.is_probed, store.asked)


def test_a_shipping_that_was_cut_before_its_manifest_needs_only_that(
    bucket: str, tmp_path: Path
) -> None:
    log = a_log(tmp_path / "log", 1)
    ship(log, UrlPath(bucket))
    ObjectStore(UrlPath(bucket)).remove("manifest.json")

    told = check_shipping(log, UrlPath(bucket))

    assert (ObjectCount(), True, 1) == (told.to_send, told.is_list_old, told.exit_code)
    assert told.superseded == ObjectCount()


@pytest.mark.parametrize("is_cut", [False, True])
def test_an_object_that_is_gone_or_cut_is_damage(
    bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], *, is_cut: bool
) -> None:
    log = a_log(tmp_path / "log", 2)
    name = ship(log, UrlPath(bucket)).manifest.segments[1].name
    store = ObjectStore(UrlPath(bucket))
    store.remove(name)
    if is_cut:
        store.create(name, b"x")

    code, out, _ = ran(capsys, "ship", str(log), bucket, "--check")

    assert (4, True) == (code, f"damage: {bucket}/{name}: " in out)


def test_what_a_shipping_refuses_the_check_refuses(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log", 1)
    other = shutil.copytree(log, tmp_path / "other")
    a_session(log)
    a_session(other)
    with pytest.raises(LogError, match="ignores the condition"):
        check_shipping(log, ForgetfulStore(UrlPath(bucket)))
    ship(log, UrlPath(bucket))

    with pytest.raises(LogError, match="continued on two machines"):
        check_shipping(other, UrlPath(bucket))


class UnlistedStore(ObjectStore):
    """Lets nobody list, as a robot's key may be."""

    def list(self):  # type: ignore[no-untyped-def]
        raise LogAccessError("403")


def test_who_may_not_list_is_told_the_rest(bucket: str, tmp_path: Path) -> None:
    log = a_log(tmp_path / "log", 1)
    ship(log, UrlPath(bucket))
    a_session(log)

    told = check_shipping(log, UnlistedStore(UrlPath(bucket)))

    assert (1, None, ()) == (told.to_send.number, told.superseded, told.problems)


def test_a_small_segment_that_is_written_on_is_neither_to_be_sent_nor_an_older_copy(
    bucket: str, tmp_path: Path
) -> None:
    """What was shipped of it is in the live one, which waits; what lies there stays as it is."""
    log = a_log(tmp_path / "log", 1)
    a_session(log)
    version = ship(log, UrlPath(bucket)).manifest.version
    with sl.append(log, compact=False) as writer:
        writer.observe("front", "open")
        writer.observe("front", "closed")

        told = check_shipping(log, UrlPath(bucket))
        done = ship(log, UrlPath(bucket))

        assert (0, 2) == (told.exit_code, told.waits_events)
        assert (0, version, 2) == (done.sent, done.manifest.version, done.waits_events)
    assert ship(log, UrlPath(bucket)).sent == 1
    assert events_of(log) == events_of(bucket)


def test_so_it_is_where_it_is_the_only_one(bucket: str, tmp_path: Path) -> None:
    sl.create(tmp_path / "log", tz="UTC").close()
    with sl.append(tmp_path / "log") as writer:
        writer.add_door(name="front")
    ship(tmp_path / "log", UrlPath(bucket))
    with sl.append(tmp_path / "log", compact=False) as writer:
        writer.observe("front", "open")

        assert check_shipping(tmp_path / "log", UrlPath(bucket)).exit_code == 0
        assert ship(tmp_path / "log", UrlPath(bucket)).sent == 0


def test_the_verb(bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = a_log(tmp_path / "log", 1)

    code, out, _ = ran(capsys, "ship", str(log), bucket, "--check")
    assert (1, True, True) == (code, "to send" in out, "No log lies there yet." in out)
    assert "honours conditional writes" in out
    ran(capsys, "ship", str(log), bucket)
    code, out, _ = ran(capsys, "ship", str(log), bucket, "--check", "--json")
    said = json.loads(out)
    assert (0, 0, 0, 1) == (code, said["exit_code"], said["to_send"], said["version"])
    assert (None, 0, []) == (said["honours_conditions"], said["superseded"], said["problems"])
