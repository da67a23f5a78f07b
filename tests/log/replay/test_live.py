"""A projection beside a writer: live, over rolls, compactions, retractions and SIGKILLs."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.events import Retracted
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.live_fold import LiveState
from semmap_log.log.trimming.redaction import Annotation, Redaction
from semmap_log.log.trimming.trim_log import trim_log
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.log.replay.projections import Numbers, Texts
from tests.log.replay.test_fold import expected_numbers

ROOT = Path(__file__).parents[3]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A log of one door, seen once: events 0 and 1."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.observe(log.add_door(), "open")
    return tmp_path / "log"


def _observe(path: Path, times: int = 1) -> None:
    with sl.append(path) as log:
        for _ in range(times):
            log.observe(1, "open")


def _now(path: Path, checkpoint: Path | None = None) -> list[tuple[list[int], int, bool]]:
    live = sl.read(path).fold_live(Numbers(), checkpoint=checkpoint, poll_s=0, stop=lambda: True)
    return [(list(now.state), now.event, now.was_restarted) for now in live]


def test_the_state_of_now_comes_at_once(path: Path, tmp_path: Path) -> None:
    """Also of an empty log, and where a checkpoint holds it already."""
    sl.create(tmp_path / "empty", tz="UTC").close()

    assert [([], -1, False)] == _now(tmp_path / "empty", tmp_path / "empty_checkpoint")
    assert [([0, 1], 1, False)] == _now(path, tmp_path / "checkpoint")
    assert [([0, 1], 1, False)] == _now(path, tmp_path / "checkpoint")


def test_a_state_after_what_came_together(path: Path) -> None:
    """Two commits between two looks are one step; where nothing came, none."""
    live = sl.read(path).fold_live(Numbers(), poll_s=0)
    assert 1 == next(live).event
    _observe(path, 2)
    second = next(live)
    _observe(path)
    third = next(live)

    assert (3, 4) == (second.event, third.event)
    assert [0, 1, 2, 3, 4] == third.state


def test_a_retraction_begins_anew(path: Path, tmp_path: Path) -> None:
    """The step says so; the state before stays as it was handed out."""
    live = sl.read(path).fold_live(Numbers(), checkpoint=tmp_path / "checkpoint", poll_s=0)
    first = next(live)
    with sl.append(path) as log:
        log.append([Retracted(first_event=1, last_event=1)])
    second = next(live)
    live.close()

    assert [0, 1] == first.state
    assert ([0, 2], 2, True) == (second.state, second.event, second.was_restarted)
    assert [([0, 2], 2, False)] == _now(path, tmp_path / "checkpoint")


def test_a_redaction_begins_anew(path: Path, tmp_path: Path) -> None:
    """The state held the text, and the checkpoint would have kept it."""
    with sl.append(path) as log:
        log.annotate(1, "owner", "Zoe")
        log.observe(1, "open")
    checkpoint = tmp_path / "checkpoint"
    live = sl.read(path).fold_live(Texts(), checkpoint=checkpoint, poll_s=0)
    assert ["Zoe"] == next(live).state
    reader = LogReader(path)

    trim_log(path, Redaction.of(reader, [Annotation(1, "owner")], reader.last_event() + 1))

    now = next(live)
    assert ([], True) == (now.state, now.was_restarted)
    live.close()  # type: ignore[attr-defined]
    assert b"Zoe" not in checkpoint.read_bytes()


def test_rolls_and_compactions_are_nothing_new(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Segments come, are merged and exchanged; each event is taken in once."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 3)
    live = sl.read(path).fold_live(Numbers(), poll_s=0)
    next(live)
    for _ in range(3):
        _observe(path, 8)
        compact(path)
        now = next(live)

    assert list(range(26)) == now.state
    assert not now.was_restarted


def test_the_checkpoint_is_saved_when_the_loop_is_left(path: Path, tmp_path: Path) -> None:
    """By break, by an error of who looks at the states, at the end; and every so often before."""
    checkpoint = tmp_path / "checkpoint"
    opened = sl.read(path)
    for _ in opened.fold_live(Numbers(), checkpoint=checkpoint):
        assert not checkpoint.exists()
        break
    assert b'"event": 1,' in checkpoint.read_bytes()
    _observe(path)
    live = opened.fold_live(Numbers(), checkpoint=checkpoint, poll_s=0)
    next(live)
    assert b'"event": 1,' in checkpoint.read_bytes()
    live.close()
    assert b'"event": 2,' in checkpoint.read_bytes()
    _observe(path)

    next(opened.fold_live(Numbers(), checkpoint=checkpoint, save_every_s=0))

    assert b'"event": 3,' in checkpoint.read_bytes()


def test_it_is_saved_while_nothing_comes(path: Path, tmp_path: Path) -> None:
    """What came last would otherwise be folded again after a kill, hours later."""
    found: list[bool] = []

    def has_been_saved() -> bool:
        found.append((tmp_path / "checkpoint").exists())
        return found[-1] or len(found) > 1000

    live = sl.read(path).fold_live(
        Numbers(),
        checkpoint=tmp_path / "checkpoint",
        save_every_s=0.1,
        poll_s=0.01,
        stop=has_been_saved,
    )

    assert 1 == len(list(live))
    assert [False, True] == [found[0], found[-1]]


def test_a_state_left_half_made_is_not_kept(path: Path, tmp_path: Path) -> None:
    """The projection fails in the middle of its own state, behind a step that was not saved yet."""

    class HalfMade(Numbers):
        name = "Numbers"

        def apply(self, state: list[int], batch: Any) -> list[int]:
            state.append(-1)
            if 3 in batch.number:
                raise ZeroDivisionError
            state.pop()
            return super().apply(state, batch)

    _now(path, tmp_path / "checkpoint")
    live = sl.read(path).fold_live(HalfMade(), checkpoint=tmp_path / "checkpoint", poll_s=0)
    next(live)
    _observe(path)
    assert [0, 1, 2] == next(live).state
    _observe(path)
    with pytest.raises(ZeroDivisionError):
        next(live)

    assert [([0, 1, 2, 3], 3, False)] == _now(path, tmp_path / "checkpoint")


def test_a_log_that_is_put_back_meanwhile_is_an_error(path: Path, tmp_path: Path) -> None:
    """States were handed out that the log knows nothing of: that is not hidden."""
    shutil.copytree(path, tmp_path / "backup")
    live = sl.read(path).fold_live(Numbers(), poll_s=0)
    next(live)
    _observe(path, 2)
    next(live)
    _observe(tmp_path / "backup", 3)
    shutil.rmtree(path)
    (tmp_path / "backup").rename(path)

    with pytest.raises(CorruptLogError, match="commit before event 4"):
        next(live)


WRITER = """
import sys, itertools, random, time
import semmap_log as sl
from semmap_log.core.model.events import Retracted
from semmap_log.store.writing import segment_chain
segment_chain.ROLL_COMMITS = 17
dice = random.Random(4)
log = sl.append(sys.argv[1])
for i in itertools.count():
    log.observe(1, "open" if i & 1 else "closed")
    time.sleep(0.001)  # the reader folds all of it anew behind each retraction, and must keep up
    if i % 40 == 39:
        number = log.state.event - dice.randrange(30)
        log.append([Retracted(first_event=number, last_event=number)])
"""

READER = """
import sys
import semmap_log as sl
from tests.log.replay.projections import Numbers, Texts
live = sl.read(sys.argv[1]).fold_live(
    Numbers(), checkpoint=sys.argv[2], save_every_s=0, poll_s=0.001
)
for now in live:
    print(now.event, len(now.state), int(now.was_restarted), flush=True)
"""


def _start(code: str, *arguments: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_killed_again_and_again_beside_a_writer(path: Path, tmp_path: Path) -> None:
    """Each time the checkpoint holds a state of the log; the next process goes on without gap."""
    checkpoint, dice = tmp_path / "checkpoint", random.Random(2)
    writer = _start(WRITER, path)
    resumed = []
    for round_ in range(8):
        reader = _start(READER, path, checkpoint)
        assert reader.stdout is not None
        first = int(reader.stdout.readline().split()[0])
        steps = [first, *(int(line.split()[0]) for line in islice(reader.stdout, 5))]
        time.sleep(dice.random() * 0.05)
        reader.send_signal(signal.SIGKILL)
        steps += [int(line.split()[0]) for line in reader.stdout if line.endswith("\n")]
        reader.stdout.close()
        reader.wait()
        assert sorted(set(steps)) == steps
        if round_ % 4 == 3:
            writer.send_signal(signal.SIGKILL)
            writer.wait()
            compact(path)
            writer = _start(WRITER, path)
        resumed.append(_saved_event(checkpoint))
    writer.send_signal(signal.SIGKILL)
    writer.wait()

    assert sorted(resumed) == resumed
    assert 3 < len(set(resumed))
    log = sl.read(path)
    assert expected_numbers(log) == log.fold(Numbers(), checkpoint=checkpoint)
    assert expected_numbers(log) == log.fold(Numbers())
    assert 0 == len(list(tmp_path.glob(".checkpoint.*.tmp")))


def _saved_event(checkpoint: Path) -> int:
    """Return the position of a checkpoint, which is whole, whatever was killed."""
    return int(json.loads(checkpoint.read_bytes().split(b"\n")[1])["event"])


def test_a_writer_in_the_same_process(path: Path) -> None:
    """A thread that folds live while another appends ends with the same state as a fold."""
    done = threading.Event()
    states: list[LiveState[list[int]]] = []

    def look() -> None:
        live = sl.read(path).fold_live(Numbers(), poll_s=0.001, stop=done.is_set)
        states.extend(LiveState(list(now.state), now.event) for now in live)

    thread = threading.Thread(target=look)
    thread.start()
    _observe(path, 200)
    done.set()
    thread.join(300)

    assert list(range(202)) == states[-1].state
    assert all(list(range(now.event + 1)) == now.state for now in states)
