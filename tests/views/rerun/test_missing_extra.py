"""Without rerun everything else works, and asking for it says how to get it."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import pytest

from semmap_log.cli.demonstration import demo
from semmap_log.errors import MissingExtraError
from semmap_log.interop.exporting.log_files import export
from tests.views.rerun.some_logs import small_log

ROOM = "semmap_log.views.rerun"


@pytest.fixture(autouse=True)
def without_rerun(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if rerun-sdk had never been installed."""
    for name in ("rerun", "rerun_cli"):
        monkeypatch.setitem(sys.modules, name, None)
    for name in [name for name in sys.modules if name.startswith(f"{ROOM}.")]:
        monkeypatch.delitem(sys.modules, name)
        monkeypatch.delattr(name, raising=False)


def test_saving_says_what_to_install(tmp_path: Path) -> None:
    """As soon as its module is imported; a demo goes on without a recording."""
    log = small_log(tmp_path / "log")

    with pytest.raises(MissingExtraError, match=r"pip install 'semmap-log\[viewer\]'"):
        import_module(f"{ROOM}.recording")
    with pytest.raises(MissingExtraError, match=r"pip install 'semmap-log\[viewer\]'"):
        export(log, tmp_path / "x.rrd")
    recording, why = demo._rrd(log, tmp_path / "x.rrd")

    assert recording is None
    assert "semmap-log[viewer]" in why
    assert not (tmp_path / "x.rrd").exists()


def test_so_does_the_viewer(tmp_path: Path) -> None:
    """Before anything is started."""
    from semmap_log.views.rerun.process import screenshot

    (tmp_path / "x.rrd").touch()

    with pytest.raises(MissingExtraError, match=r"pip install 'semmap-log\[viewer\]'"):
        screenshot(tmp_path / "x.rrd", tmp_path / "x.png")
