"""Without rerun everything else works, and asking for it says how to get it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from semmap_log.errors import MissingExtraError
from tests.views.rerun.some_logs import small_log

EDGE = ("rerun_sdk", "rows", "robot_track", "blueprint", "file", "door_entities", "event_markers",
        "floor", "live_view")  # fmt: skip


@pytest.fixture(autouse=True)
def without_rerun(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if rerun-sdk had never been installed."""
    for name in ("rerun", "rerun_cli"):
        monkeypatch.setitem(sys.modules, name, None)
    for name in EDGE:
        monkeypatch.delitem(sys.modules, f"semmap_log.views.rerun.{name}", raising=False)


def test_saving_says_what_to_install(tmp_path: Path) -> None:
    """
    The module itself can be imported; nothing is written.
    """
    from semmap_log.views.rerun.recording import save_rrd

    with pytest.raises(MissingExtraError, match=r"pip install 'semmap-log\[viewer\]'"):
        save_rrd(small_log(tmp_path / "log"), tmp_path / "x.rrd")

    assert not (tmp_path / "x.rrd").exists()


def test_so_does_the_viewer(tmp_path: Path) -> None:
    """
    Before anything is started.
    """
    from semmap_log.views.rerun.process import screenshot

    (tmp_path / "x.rrd").touch()

    with pytest.raises(MissingExtraError, match=r"pip install 'semmap-log\[viewer\]'"):
        screenshot(tmp_path / "x.rrd", tmp_path / "x.png")
