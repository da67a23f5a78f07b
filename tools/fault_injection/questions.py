"""What is asked of a log, and its answers as values that compare: NaN is NaN."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import semmap_log as sl
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError

Question = Callable[[sl.DoorLog], Any]
Answers = Mapping[str, Any]


def questions(moments: list[int], numbers: list[int]) -> dict[str, Question]:
    """Return what to ask of a log; the first two read every byte that counts."""
    asked: dict[str, Question] = {
        "commits": lambda log: list(log.commits()),
        "events": lambda log: _plain(log.batches_in()),
        "replay": lambda log: repr(log.replay()),
        "history": lambda log: [_text(entry) for entry in log.history()],
        "floor map": lambda log: _text(log.floor_map(1)),
        "end": lambda log: log.end_ns(),
    }
    for ns in moments:
        asked[f"known at {ns}"] = lambda log, ns=ns: repr(log.replay(known_at=ns))
        asked[f"at {ns}"] = lambda log, ns=ns: repr(log.replay(at=ns))
    for number in numbers:
        asked[f"event {number}"] = lambda log, n=number: _text(log.event(n))
        asked[f"entry {number}"] = lambda log, n=number: _text(log.entry(n))
        asked[f"up to {number}"] = lambda log, n=number: repr(log.replay(event=n))
    return asked


def answer(ask: Question, log: sl.DoorLog) -> Any:
    """Return what a log answers; that there is no such event is an answer, too."""
    try:
        return ask(log)
    except (CorruptLogError, NotALogError, LogAccessError):
        raise
    except LogError as error:  # such as: there is no event 12
        return f"{type(error).__name__}: {str(error).removeprefix(str(log.path))}"


def _plain(batches: Iterable[EventBatch]) -> Any:
    """Return batches as values that compare, however they are split: NaN is NaN."""
    stamps: tuple[list[int], ...] = ([], [], [], [])
    columns: dict[int, bytes] = {}
    texts: dict[int, list[str]] = {}
    for batch in batches:
        arrays = (batch.number, batch.kind, batch.happened_ns, batch.recorded_ns)
        for values, array in zip(stamps, arrays, strict=True):
            values.extend(array.tolist())
        for kind, rows in batch.columns.items():
            columns[kind] = columns.get(kind, b"") + rows.tobytes()
        for kind, events in batch.objects.items():
            texts.setdefault(kind, []).extend(map(_text, events))
    return stamps, columns, texts


def _text(value: Any) -> str:
    cells = getattr(getattr(value, "event", value), "cells", None)
    assert cells is None or isinstance(getattr(value, "event", value), FloorMap)
    return repr(value) if cells is None else f"{value!r} {cells.tobytes()!r}"
