"""`serve --ask … --ship URL` as a process: planners ask and write, and the store has it all."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import semmap_log as sl
from semmap_log.core.io.url_path import UrlPath
from semmap_log.log.replay.maintenance import verify
from tests.fleet.test_shipping import events_of
from tests.live.planners.line_protocol.running_server import Raw, unix_in
from tests.live.ros.running import Running


@contextmanager
def _serving(*words: str, folder: Path) -> Iterator[Running]:
    folder.mkdir()
    with (folder / "stdout").open("wb") as stdout, (folder / "stderr").open("wb") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "semmap_log", "serve", *words],
            stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr,
        )  # fmt: skip
    with Running(process, "serve", folder) as running:
        running.wait_for("questions are taken at")
        yield running


def test_what_planners_write_is_shipped_when_the_server_is_ended(
    bucket: str, tmp_path: Path
) -> None:
    log = tmp_path / "office"
    with sl.create(log, tz="UTC") as writer:
        door = writer.add_door(name="front", state="open")
    address = unix_in(tmp_path)
    words = (str(log), "--ask", address, "--ship", bucket)
    with _serving(*words, folder=tmp_path / "said") as server:
        with Raw(address) as client:
            assert client.ask(f"DOOR_OPEN DOOR_{door}") == "T"
            assert client.ask(f"SET_DOOR_CLOSED DOOR_{door}") == "T"
            assert client.ask(f"DOOR_OPEN DOOR_{door}") == "NIL"
        written = sl.read(log).last_event()

        assert server.stop(signal.SIGTERM) == 0

        assert f"{bucket}: shipped up to event {written}." in server.errors
    assert events_of(log) == events_of(bucket)
    assert sl.read(bucket).replay().doors[door].state.name == "CLOSED"
    assert verify(UrlPath(bucket)).exit_code == 0
