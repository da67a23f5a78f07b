"""Requests of each verb fail once, in each way: the answer is the same, or a named error."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from semmap_log.cli import main
from semmap_log.core.io import object_source
from semmap_log.core.io.url_path import UrlPath
from semmap_log.fleet.shipping import ship
from tests.fleet.jobs.fleets import make_log
from tests.fleet.lying_store import Answer, Lie, honest, lying_store, objects_below

URL = "s3://fleet/log"
VERBS = {
    "replay": ("--json",),
    "replay then": ("--at", "event:30", "--json"),
    "history": ("d0", "--json"),
    "diff": ("event:5", "event:60", "--json"),
    "timeline": ("d0", "--json"),
    "probabilities": ("--json",),
    "info": ("--json",),
    "tail": ("--json",),
    "export": ("OUT.jsonl",),
    "costmap": ("OUT.pgm", "--level", "0"),
}
"""Word by word; the first is the verb."""


def _cut(answer: Answer) -> Answer:
    status, body, said = answer
    return status, body[: len(body) // 2], said


def _short(answer: Answer) -> Answer:
    status, body, _ = answer
    return status, body[:-1], len(body) - 1


def _altered(answer: Answer) -> Answer:
    status, body, said = answer
    changed = bytearray(body)
    if changed:
        changed[len(changed) // 2] ^= 4
    return status, bytes(changed), said


def _zeros(answer: Answer) -> Answer:
    return answer[0], bytes(len(answer[1])), answer[2]


def _status(number: int) -> Callable[[Answer], Answer]:
    return lambda _: (number, b"", 0)


FAULTS: dict[str, Callable[[Answer], Answer]] = {
    "cut": _cut, "short": _short, "altered": _altered, "zeros": _zeros,
    **{str(number): _status(number) for number in (403, 404, 416, 503)},
}  # fmt: skip


@pytest.fixture
def objects(bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The objects of a shipped log; read by many small requests, as a large one is."""
    make_log(tmp_path / "log", 1, hours=26)
    ship(tmp_path / "log", UrlPath(bucket))
    folder = objects_below(bucket, tmp_path / "objects")
    monkeypatch.setattr(object_source, "SMALL_BYTES", 0)
    monkeypatch.setattr(object_source, "BLOCK_BYTES", 8192)
    monkeypatch.setattr(object_source, "GAP_BLOCKS", 0)
    return folder


def _asked(
    words: str, objects: Path, lie: Lie, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> tuple[int, str, str]:  # fmt: skip
    """Exit code, what was answered (the bytes of a file, where it is one), and what was said."""
    out = objects.parent / "out"
    given = [str(out.with_suffix(Path(w).suffix)) if w.startswith("OUT") else w
             for w in VERBS[words]]  # fmt: skip
    object_source._kept.clear()
    for path in objects.parent.glob("out.*"):
        path.unlink()
    with lying_store(objects, lie) as environment:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit) as ended:
            main([words.split(maxsplit=1)[0], URL, *given])
    answer, said = capsys.readouterr()
    files = sorted(objects.parent.glob("out.*"))
    return int(ended.value.code or 0), answer + "".join(map(_text, files)), said


def _text(path: Path) -> str:
    return path.read_bytes().hex()


def _attacked(
    words: str, objects: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch, *, most: int, faults: Iterable[str] = FAULTS,
) -> int:  # fmt: skip
    """
    Have some `most` of the requests fail, each in each way; return how often the answer stood.
    """
    asked = 0

    def counting(number: int, answer: Answer) -> Answer:
        nonlocal asked
        asked = number + 1
        return honest(number, answer)

    whole = _asked(words, objects, counting, capsys, monkeypatch)
    assert whole[0] == 0, whole
    stood, step = 0, max(1, asked // most)
    for name in faults:
        fault = FAULTS[name]
        for at in range(0, asked, step):

            def lie(number: int, answer: Answer, at: int = at, fault: object = fault) -> Answer:
                return fault(answer) if number == at else answer  # type: ignore[operator]

            code, answer, said = _asked(words, objects, lie, capsys, monkeypatch)
            where = f"{words}: request {at} of {asked}: {name}: {said}"
            assert "Traceback" not in said, where
            if code == 0:
                assert answer == whole[1], where
                stood += 1
            else:
                assert code == 1, where
                assert URL in said or URL in answer, where
    return stood


def test_bytes_that_are_altered_and_objects_that_go(
    objects: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """At each request of a moment's map."""
    _attacked("replay then", objects, capsys, monkeypatch, most=100, faults=["altered", "404"])


@pytest.mark.slow
@pytest.mark.parametrize("words", VERBS)
def test_requests_that_fail_in_each_way(
    words: str, objects: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert 0 < _attacked(words, objects, capsys, monkeypatch, most=3)
