"""A real OpenPRS kernel with the module in it; skipped where SEMMAP_OPRS does not name one."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from tests.live.oprs.building import ROOT
from tests.live.ros.running import Running

PLANS = Path(__file__).parent / "plans.opf"
SERVER = Path(__file__).parent / "door_server.py"


@dataclass(frozen=True)
class Oprs:
    """A kernel's program, and the module built for it."""

    program: Path
    include: Path


class Workshop:
    """Starts servers and kernels of one test."""

    def __init__(self, oprs: Oprs, folder: Path, stack: ExitStack) -> None:
        self.oprs = oprs
        self.folder = folder
        self.stack = stack
        self.address = f"unix:{folder}/doors"
        self.journal = folder / "journal"
        self.count = iter(range(100))

    def serve(self, *options: str) -> Running:
        """Start the tests' door map."""
        server = self.run([sys.executable, SERVER, self.address, self.journal, *options])
        server.wait_for("^ready$")
        return server

    def kernel(
        self,
        *commands: str,
        include: Path | None = None,
        address: str | None = None,
        fold: str = "none",
        timeout_ms: int = 60_000,
    ) -> Running:
        """Start a kernel that loads the module and our plans, and then runs commands."""
        number = next(self.count)
        words = [
            self.oprs.program, "-a", "-A", "-q", "-l", fold, "-n", f"K{number}",
            "-x", include or self.oprs.include,
        ]  # fmt: skip
        for command in (f'load opf "{PLANS}"', *commands):
            words += ["-c", command]
        return self.run(
            words, SEMMAP_ASK=address or self.address, SEMMAP_ASK_TIMEOUT_MS=str(timeout_ms)
        )

    def run(self, words: Sequence[object], **environment: str) -> Running:
        """Start a program; it ends with the test."""
        folder = self.folder / f"run{next(self.count)}"
        return self.stack.enter_context(run_in(folder, words, **environment))

    def actions(self) -> list[str]:
        """Return what was stored, without command ids."""
        lines = self.journal.read_text(encoding="utf-8").splitlines()
        return [line.partition(" ")[2] for line in lines]


def run_in(folder: Path, words: Sequence[object], **environment: str) -> Running:
    """Start a program, its output in files: a pipe that nobody reads stops a kernel."""
    folder.mkdir()
    with (folder / "stdout").open("wb") as out, (folder / "stderr").open("wb") as err:
        process = subprocess.Popen(
            [str(word) for word in words], stdin=subprocess.DEVNULL, stdout=out, stderr=err,
            cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        )  # fmt: skip
    return Running(process, str(words[0]), folder)
