"""Which kernels are there: by what the passer says, and by our messages to ourselves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.live.planners.kernels.message_passer import (
    FIRST_PAUSE_S,
    LONGEST_PAUSE_S,
    ToldKernels,
)
from semmap_log.live.planners.kernels.s_expressions import read_expression
from tests.live.planners.kernels.kernel_world import make_log
from tests.live.planners.kernels.test_passer_frames import parts_of


class Told:
    """Kernels that are told, and all that was sent: recipients and text."""

    def __init__(self, log: Any, *kernels: str) -> None:
        self.log = log
        self.sent: list[tuple[list[str], str]] = []
        self.kernels = ToldKernels("SEMMAP", kernels, lambda data: self.sent.append(parts_of(data)))
        self.take()

    def take(self) -> None:
        self.kernels.take(self.log.door_map())

    def news(self) -> list[tuple[list[str], str]]:
        """Return what was sent since the last time."""
        news, self.sent[:] = list(self.sent), []
        return news

    def let_return(self) -> None:
        """Let all messages to ourselves return."""
        for names, text in list(self.sent):
            if names == ["SEMMAP"]:
                self.kernels.returned(read_expression(text)[-1])


@pytest.fixture
def told(tmp_path: Path) -> Any:
    with sl.append(make_log(tmp_path / "log")) as log:
        yield Told(log, "K1", "K2")


def _change(told: Told, state: str) -> list[tuple[list[str], str]]:
    told.log.observe(1, state)
    told.news()
    told.take()
    return told.news()


def test_who_is_not_unknown_is_there(told: Told) -> None:
    """Once our own message is back, which went behind the call."""
    told.kernels.call(0.0)
    assert told.sent == [
        (["K1"], "(DOOR_MAP SEMMAP)"),
        (["K2"], "(DOOR_MAP SEMMAP)"),
        (["SEMMAP"], "(SEMMAP_ECHO 1)"),
    ]
    told.kernels.is_unknown("K2", 0.1)
    told.let_return()
    news = told.news()

    assert "(DOOR_FACTS SEMMAP 3)" in [text for names, text in news if names == ["K1"]]
    assert ["(DOOR_MAP SEMMAP)"] == [text for names, text in news if names == ["K2"]]
    assert _change(told, "closed") == [(["K1"], "(DOOR_STATE DOOR_1 CLOSED)")]


def test_no_change_is_told_to_who_is_not_there(told: Told) -> None:
    """Nor to who was only called."""
    assert _change(told, "closed") == []
    told.kernels.call(0.0)
    assert _change(told, "open") == []


def test_who_has_gone_is_told_no_changes(told: Told) -> None:
    """Until it was called again, and is there."""
    told.kernels.call(0.0)
    told.let_return()
    both = [(["K1", "K2"], "(DOOR_STATE DOOR_1 CLOSED)")]
    assert _change(told, "closed") == both
    told.kernels.is_unknown("K2", 1.0)
    assert told.kernels.next_call_s == 1.0 + FIRST_PAUSE_S
    assert _change(told, "open") == [(["K1"], "(DOOR_STATE DOOR_1 OPEN)")]
    told.kernels.call(1.0 + FIRST_PAUSE_S)
    told.let_return()
    assert told.kernels.next_call_s is None
    assert _change(told, "closed") == both


def test_calls_become_rarer(told: Told) -> None:
    """The passer complains of each that is in vain."""
    times, now_s = [], 0.0
    for _ in range(8):
        told.kernels.call(now_s)
        for name in ("K1", "K2"):
            told.kernels.is_unknown(name, now_s)
        told.let_return()
        assert told.kernels.next_call_s is not None
        times.append(told.kernels.next_call_s - now_s)
        now_s = told.kernels.next_call_s

    assert times == [0.5, 1.0, 2.0, 4.0, *[LONGEST_PAUSE_S] * 4]


def test_who_says_something_is_called_at_once(told: Told) -> None:
    """It need not wait for its turn."""
    told.kernels.call(0.0)
    told.kernels.is_unknown("K1", 0.1)
    told.kernels.is_there("K1")
    told.kernels.is_there("nobody")
    told.news()
    told.kernels.call(0.2)

    assert (["K1"], "(DOOR_MAP SEMMAP)") in told.sent


def test_who_asks_for_all_is_told_once(told: Told) -> None:
    """Though it was called just before."""
    told.kernels.call(0.0)
    told.kernels.tell_all("K1")
    told.let_return()

    assert told.sent.count((["K1"], "(DOOR_FACTS SEMMAP 3)")) == 1
