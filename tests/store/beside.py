"""A log that another program is writing, and what that has acknowledged."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from doc_pages import ROOT

PROGRAM = Path(__file__).with_name("recording_beside.py")


class Recorder:
    """The program beside, and what it has acknowledged."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.acknowledged = -1
        self._process = process
        self._begun = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.acknowledged = int(line)
            self._begun.set()

    def wait_until_begun(self) -> None:
        assert self._begun.wait(60)

    def end(self) -> None:
        """Let it end, and check that nothing went wrong there."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        assert 0 == self._process.wait(60)
        self._thread.join(60)


@contextmanager
def recording(log: Path, seed: int) -> Iterator[Recorder]:
    line = [sys.executable, str(PROGRAM), str(log), str(seed)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(line, **pipes, text=True, env=environment) as process:
        try:
            recorder = Recorder(process)
            recorder.wait_until_begun()
            yield recorder
        finally:
            process.kill()
