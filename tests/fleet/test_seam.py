"""Where a store, a manifest or a process is not what was thought: told, and never an answer."""

from __future__ import annotations

import hashlib
import json
import math
import multiprocessing
import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.shipping import check_conditions, ship
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.byte_layout import DIGEST_KEY
from tests.bucket import NAME
from tests.fleet.test_shipping import RECORDINGS, events_of
from tests.verbs import run
from tests.web_server import web_server

OFFICE = RECORDINGS / "office"
WEEK = RECORDINGS / "clinic_week"


def _in_a_fork(url: str, said: Any) -> None:
    try:
        said.send(len(sl.read(url).replay().doors))
    except LogError as error:
        said.send(str(error))


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("is_open", [False, True])
def test_a_forked_process_is_told(bucket: str, *, is_open: bool) -> None:
    """Threads that ask a store do not come along by a fork."""
    ship(OFFICE, UrlPath(bucket))
    doors = len(sl.read(bucket).replay().doors) if is_open else 3
    answers = {}
    for way in ("fork", "spawn"):
        context = multiprocessing.get_context(way)
        ours, theirs = context.Pipe()
        child = context.Process(target=_in_a_fork, args=(bucket, theirs))
        child.start()
        theirs.close()
        assert ours.poll(120), "the child waits"
        answers[way] = ours.recv()
        child.join(60)

    assert "get_context('spawn')" in answers["fork"]
    assert doors == answers["spawn"] if is_open else answers["spawn"]


def _downloaded(bucket: str, folder: Path) -> Path:
    store = ObjectStore(UrlPath(bucket))
    folder.mkdir()
    for status in store.list():
        got = store.whole(status.name, most_bytes=2**24)
        assert got is not None
        (folder / status.name).write_bytes(got[0])
    return folder


def test_a_shipped_log_at_a_plain_web_server(
    bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A server that lists nothing: the manifest tells what there is, for answers and for verify."""
    ship(WEEK, UrlPath(bucket))
    copy = _downloaded(bucket, tmp_path / "copy")
    asked: Counter[str] = Counter()

    with web_server(copy, asked) as url:
        assert repr(sl.read(WEEK).replay()) == repr(sl.read(url).replay())
        assert 0 == run("verify", url)
        fetch(UrlPath(url), tmp_path / "back")
        name = sorted(path.name for path in copy.glob("*.mcap"))[3]
        data = bytearray((copy / name).read_bytes())
        data[-1000] ^= 1
        (copy / name).write_bytes(data)
        assert 4 == run("verify", url)
        (copy / name).unlink()
        capsys.readouterr()
        assert 4 == run("verify", url)

    assert name in capsys.readouterr().out
    assert events_of(WEEK) == events_of(tmp_path / "back")


def test_a_server_that_lists_nothing_is_asked_once(tmp_path: Path) -> None:
    """Each refusal takes a while: it is remembered."""
    asked: Counter[str] = Counter()
    with web_server(OFFICE, asked) as url:
        for _ in range(3):
            assert repr(sl.read(OFFICE).replay()) == repr(sl.read(url).replay())

    assert 3 >= asked["PROPFIND"]


FIELDS: dict[str, Callable[[dict[str, Any]], object]] = {
    "bytes": lambda one: one["bytes"] + 1,
    "sha256": lambda one: "0" * 64,
    "head_end": lambda one: one["head_end"] - 1,
    "head": lambda one: "11" * 32,
    "counts": lambda one: {**one["counts"], "1": one["counts"].get("1", 0)} | {"77": 0},
    "recorded_ns": lambda one: [one["recorded_ns"][0] - 1, one["recorded_ns"][1]],
    "happened_ns": lambda one: [one["happened_ns"][0], one["happened_ns"][1] + 1],
    "format_minor": lambda one: one["format_minor"] + 1,
    "others": lambda one: [["stranger", "1"]],
}


def _rewritten(bucket: str, change: Callable[[dict[str, Any]], None]) -> None:
    """Put a manifest in the place of the one that lies there, as a liar with all rights would."""
    store = ObjectStore(UrlPath(bucket))
    got = store.whole("manifest.json", most_bytes=2**24)
    assert got is not None
    entries = json.loads(got[0])
    del entries[DIGEST_KEY]
    change(entries)
    text = json.dumps(entries, sort_keys=True).encode()
    entries[DIGEST_KEY] = hashlib.sha256(text).hexdigest()
    assert store.replace("manifest.json", json.dumps(entries).encode(), got[1].e_tag)


@pytest.mark.parametrize("name", FIELDS)
def test_verify_compares_all_that_a_manifest_tells(
    bucket: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the last segment, whose hash no other one holds."""
    ship(WEEK, UrlPath(bucket))
    assert 0 == verify(UrlPath(bucket)).exit_code

    def change(entries: dict[str, Any]) -> None:
        last = entries["segments"][-1]
        last[name] = FIELDS[name](last)

    _rewritten(bucket, change)

    assert 4 == run("verify", bucket), name
    assert "manifest" in capsys.readouterr().out


IMPOSSIBLE: dict[str, Callable[[dict[str, Any]], object]] = {
    "a size below zero": lambda all_: all_["segments"][1].update(bytes=-5),
    "a size of a half": lambda all_: all_["segments"][1].update(bytes=1.5),
    "a name elsewhere": lambda all_: all_["segments"][1].update(name="../x.mcap"),
    "a hidden name": lambda all_: all_["segments"][1].update(name=".x.mcap"),
    "one name twice": lambda all_: all_["segments"][1].update(name=all_["segments"][2]["name"]),
    "numbers that go back": lambda all_: all_["segments"][1].update(last_segment=0),
    "events that are not counted": lambda all_: all_["segments"][-1].update(next_event=10**9),
    "fewer than none": lambda all_: all_["segments"][1]["counts"].update({"1": -1}),
    "times that go back": lambda all_: all_["segments"][1].update(recorded_ns=[9, 3]),
    "a time without end": lambda all_: all_["segments"][1].update(happened_ns=[0, math.inf]),
    "a time after all time": lambda all_: all_["segments"][1].update(happened_ns=[0, 2**63]),
    "a size without end": lambda all_: all_.update(superseded=[["x.mcap", math.inf, None]]),
    "a head behind the end": lambda all_: all_["segments"][1].update(head_end=10**12),
    "no hash": lambda all_: all_["segments"][1].update(sha256="zz"),
    "a list of nothing": lambda all_: all_.update(segments=[]),
    "a list that is none": lambda all_: all_.update(segments={"0": 1}),
    "a gap": lambda all_: all_["segments"].pop(2),
    "another order": lambda all_: all_["segments"].reverse(),
    "a version of a word": lambda all_: all_.update(version="new"),
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_a_manifest_that_cannot_be_is_damage(
    bucket: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each verb names it; none answers."""
    ship(WEEK, UrlPath(bucket))
    _rewritten(bucket, lambda entries: (IMPOSSIBLE[name](entries), None)[1])

    with pytest.raises(CorruptLogError, match="manifest"):
        sl.read(bucket)
    for verb in ("replay", "info", "verify", "history"):
        assert run(verb, bucket), verb
        assert "manifest" in "".join(capsys.readouterr()), verb


def test_a_manifest_that_is_nested_without_end_is_damage(bucket: str) -> None:
    ship(OFFICE, UrlPath(bucket))
    store = ObjectStore(UrlPath(bucket))
    got = store.whole("manifest.json", most_bytes=2**24)
    assert got is not None
    store.replace("manifest.json", b"[" * 100_000, got[1].e_tag)

    with pytest.raises(CorruptLogError, match="manifest"):
        sl.read(bucket)


def test_bytes_that_lie_there_are_compared(bucket: str, tmp_path: Path) -> None:
    """An object of a segment's name and size with other bytes: no manifest ever names it."""
    done = ship(OFFICE, UrlPath(bucket))
    (name,) = (one.name for one in done.manifest.segments)
    store = ObjectStore(UrlPath(bucket))
    store.remove("manifest.json")
    store.remove(name)
    store.create(name, bytes(done.manifest.segments[0].size))

    with pytest.raises(LogError, match="an object with other bytes"):
        ship(OFFICE, UrlPath(bucket))

    assert [name] == [status.name for status in store.list()]


class HalfForgetfulStore(ObjectStore):
    """Ignores If-Match in silence."""

    def replace(self, name: str, data: bytes, e_tag: str) -> bool:
        self._asked(name, lambda: self._obstore.put(self._store, name, data))
        return True


def test_a_store_that_ignores_if_match_is_refused(bucket: str) -> None:
    """The manifest of another robot would be written over there."""
    with pytest.raises(LogError, match="ignores the condition `If-Match`"):
        ship(OFFICE, HalfForgetfulStore(UrlPath(bucket)))
    check_conditions(ObjectStore(UrlPath(bucket)))

    assert [] == ObjectStore(UrlPath(bucket)).list()


@pytest.mark.parametrize("verb", [["ship", str(OFFICE)], ["info"], ["verify"], ["replay"]])
def test_a_bucket_that_is_not_there_is_named(
    bucket: str, verb: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"/{NAME}/" in bucket
    url = bucket.replace(f"/{NAME}/", "/nobodys-bucket/")

    assert 1 == run(*verb, url)

    assert "the bucket does not exist" in capsys.readouterr().err


@pytest.mark.parametrize("verb", [["ship", str(OFFICE)], ["info"], ["verify"], ["tail"]])
@pytest.mark.parametrize("is_there", [False, True])
def test_no_key_and_no_password_is_in_a_message(
    bucket: str, verb: list[str], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], *, is_there: bool,
) -> None:  # fmt: skip
    """Also where the endpoint has them, and where the store says them again."""
    port = os.environ["AWS_ENDPOINT_URL"].rsplit(":", 1)[-1] if is_there else "9"
    bucket = bucket.replace(f"/{NAME}/", "/nobodys-bucket/")
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://anna:pa55word@127.0.0.1:{port}")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "SENTINELKEY")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "SENTINELSECRET")
    monkeypatch.setenv("AWS_SESSION_TOKEN", "SENTINELTOKEN")

    code = run(*verb, bucket)

    said = "".join(capsys.readouterr())
    assert code
    for secret in ("pa55word", "SENTINELKEY", "SENTINELSECRET", "SENTINELTOKEN"):
        assert secret not in said


def test_what_verify_says_to_do_about_damage_mends_it(
    bucket: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Remove what it names, and the manifest; ship again: only what was removed is sent."""
    done = ship(WEEK, UrlPath(bucket))
    store = ObjectStore(UrlPath(bucket))
    name = done.manifest.segments[2].name
    store.remove(name)
    store.create(name, bytes(done.manifest.segments[2].size))
    assert 4 == run("verify", bucket)
    said = capsys.readouterr().out
    assert name in said
    assert "manifest.json there" in said
    assert f"ship LOG {bucket}" in said

    store.remove(name)
    store.remove("manifest.json")
    again = ship(WEEK, UrlPath(bucket))

    assert 1 == again.sent
    assert 0 == verify(UrlPath(bucket)).exit_code
