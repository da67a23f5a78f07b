"""Stores that fail, cut their answers, or lie: the right answer, or an error, and soon."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.object_source import _kept
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogError
from semmap_log.fleet.shipping import ship
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.removed_source import ObjectSegments
from tests.fleet.lying_store import Answer, Lie, honest, lying_store, objects_below
from tests.fleet.test_shipping import a_log, events_of


@pytest.fixture
def shipped(bucket: str, tmp_path: Path) -> tuple[Path, Path]:
    """A log, and the objects of it as they lie in a store."""
    log = a_log(tmp_path / "log")
    ship(log, UrlPath(bucket))
    return log, objects_below(bucket, tmp_path / "objects")


def asked(objects: Path, monkeypatch: pytest.MonkeyPatch, lie: Lie) -> list[str]:
    _kept.clear()
    with lying_store(objects, lie) as environment:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        store = ObjectStore(UrlPath("s3://bucket/log"), patience_s=4.0)
        log = sl.DoorLog(LogReader(ObjectSegments(store)))
        return [repr(event) for batch in log.batches_in() for event in batch]


def test_an_honest_one_answers(shipped: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    log, objects = shipped

    assert events_of(log) == asked(objects, monkeypatch, honest)


def _failed(status: int) -> Callable[[Answer], Answer]:
    return lambda _: (status, b"", 0)


def _half(answer: Answer) -> Answer:
    status, body, said = answer
    return status, body[: len(body) // 2], said


@pytest.mark.parametrize("harmed", [_failed(429), _failed(500), _failed(503), _half])
def test_one_that_fails_now_and_then_is_asked_again(
    shipped: tuple[Path, Path],
    monkeypatch: pytest.MonkeyPatch,
    harmed: Callable[[Answer], Answer],
) -> None:
    log, objects = shipped

    def every_other(number: int, answer: Answer) -> Answer:
        return answer if number % 2 else harmed(answer)

    assert events_of(log) == asked(objects, monkeypatch, every_other)


def _cut(_: int, answer: Answer) -> Answer:
    status, body, said = answer
    return status, body[: len(body) // 2], said


def _short(_: int, answer: Answer) -> Answer:
    status, body, _ = answer
    return status, body[:-1], len(body) - 1


def _forbidden(_: int, answer: Answer) -> Answer:
    return 403, b"", 0


def _zeros(_: int, answer: Answer) -> Answer:
    status, body, said = answer
    return status, bytes(len(body)), said


def _flipped(_: int, answer: Answer) -> Answer:
    status, body, said = answer
    changed = bytearray(body)
    changed[len(body) // 3] ^= 16
    return status, bytes(changed), said


def _another_range(number: int, answer: Answer) -> Answer:
    status, body, said = answer
    return (status, body[::-1], said) if number else answer


@pytest.mark.parametrize("lie", [_cut, _short, _forbidden, _zeros, _flipped, _another_range])
def test_one_that_always_lies_gives_no_answer(
    shipped: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, lie: Lie
) -> None:
    """Also where the manifest is right, and only what it names is not."""
    _, objects = shipped

    with pytest.raises(LogError):
        asked(objects, monkeypatch, lie)
    with pytest.raises(LogError):
        asked(
            objects, monkeypatch, lambda number, answer: lie(number, answer) if number else answer
        )
