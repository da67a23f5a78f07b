"""Joins of logs of which sightings were thinned, where another log saw a door otherwise."""

from __future__ import annotations

import random
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import trim_log
from semmap_log.store.reading.reader import LogReader
from tests.log.trimming.logs import SECOND_NS, START_NS, MinuteClock, answers_of

pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")

HOUR_NS = 3600 * SECOND_NS
BEGIN_NS = START_NS // HOUR_NS * HOUR_NS + HOUR_NS
FRAMES = dict.fromkeys(("one", "two"), (0.0, 0.0, 0.0))


def watched(path: Path, looks: Sequence[tuple[int, str]]) -> Path:
    """Return a log of a door that was seen at these seconds, each recorded at once."""
    clock = MinuteClock()
    clock.now_ns += len(path.name) * SECOND_NS // 7
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=0.9, name="front", state="closed")
        for second, state in looks:
            clock.now_ns = BEGIN_NS + second * SECOND_NS
            log.observe(1, state, at=f"@{clock.now_ns}")
    return path


def thinned(log: Path) -> Path:
    copy = Path(shutil.copytree(log, log.parent / "thinned" / log.name))
    trim_log(copy, Thinning(LogReader(copy), BEGIN_NS + 24 * HOUR_NS))
    return copy


def joined(one: Path, two: Path) -> sl.DoorLog:
    return sl.join({"one": one, "two": two}, frames=FRAMES)


EVERY_MINUTE = [(60 * i, "open") for i in range(50)]


@pytest.mark.parametrize(
    ("second", "state", "is_conflict"),
    [(601, "closed", True), (601, "open", False), (3100, "closed", False), (-5, "closed", False),
     (2879, "closed", True), (2881, "closed", False)],
)  # fmt: skip
def test_a_join_begins_after_what_cannot_be_known(
    tmp_path: Path, second: int, state: str, *, is_conflict: bool
) -> None:
    """Only where the other log saw another state between sightings of which the next is gone."""
    one, two = watched(tmp_path / "one", EVERY_MINUTE), watched(tmp_path / "two", [(second, state)])
    whole, trimmed = joined(one, two), joined(thinned(one), two)

    assert (trimmed.horizon_ns() > 0) is is_conflict
    asked = [{"at": f"@{BEGIN_NS + s * SECOND_NS}"} for s in range(-60, 3700, 20)]
    for moment, was, now in zip(asked, answers_of(whole, asked), answers_of(trimmed, asked),
                                strict=True):  # fmt: skip
        is_kept = int(moment["at"][1:]) >= trimmed.horizon_ns()
        assert now == (was if is_kept else "HorizonError")


@pytest.mark.parametrize("seed", range(8))
def test_no_answer_of_a_join_is_another(tmp_path: Path, seed: int) -> None:
    """Random looks of two robots, one or both thinned: at what had happened and what was known."""
    draw = random.Random(seed)
    logs = []
    for name in ("one", "two"):
        looks, second, state = [], 0, "open"
        while second < 4 * 3600:
            second += draw.choice([60, 120, 400])
            if draw.random() < 0.05:
                state = draw.choice(["open", "closed"])
            looks.append((second, state))
        logs.append(watched(tmp_path / name, looks))
    whole = joined(*logs)
    trimmed = joined(thinned(logs[0]), thinned(logs[1]) if seed % 2 else logs[1])

    at = [f"@{BEGIN_NS + draw.randrange(5 * 3600) * SECOND_NS}" for _ in range(60)]
    asked = [{"at": one} for one in at] + [{"known_at": one} for one in at]
    asked += [{"at": one, "known_at": other} for one, other in zip(at, sorted(at), strict=True)]
    refused = 0
    for moment, was, now in zip(asked, answers_of(whole, asked), answers_of(trimmed, asked),
                                strict=True):  # fmt: skip
        is_kept = all(int(told[1:]) >= trimmed.horizon_ns() for told in moment.values())
        assert now == (was if is_kept else "HorizonError"), moment
        refused += not is_kept
    assert refused
