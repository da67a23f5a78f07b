"""A stub kernel that runs: one line in, one line out."""

from __future__ import annotations

import os
import select
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.live.ros.running import DEADLINE_S


class StubKernel:
    """The module in a process; `with` ends it, and fails where a sanitizer found something."""

    def __init__(
        self,
        command: Sequence[str | Path],
        errors: Path,
        *,
        address: str | None = None,
        environment: Mapping[str, str] | None = None,
        stderr: int | None = None,
    ) -> None:
        self.errors_path = errors
        clean = {k: v for k, v in os.environ.items() if not k.startswith(("SEMMAP", "LC_", "LANG"))}
        given = {"SEMMAP_ASK": address} if address else {}
        with errors.open("wb") as file:
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=file if stderr is None else stderr,
                env={**clean, **given, **(environment or {})},
            )  # fmt: skip
        self._read = b""

    @property
    def errors(self) -> str:
        """Return what it has written to standard error."""
        return self.errors_path.read_text(encoding="utf-8", errors="replace")

    def call(self, line: str) -> str:
        """Return what a line is answered; fail if it is not, by a generous deadline."""
        self.send(line)
        return self.result()

    def send(self, line: str) -> None:
        """Write a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(line.encode() + b"\n")
        self.process.stdin.flush()

    def result(self) -> str:
        """Read the next answer."""
        assert self.process.stdout is not None
        end = time.monotonic() + DEADLINE_S
        while b"\n" not in self._read:
            left = end - time.monotonic()
            ready, _, _ = select.select([self.process.stdout], [], [], max(0, left))
            assert ready, f"no answer in {DEADLINE_S:.0f} s: {self.errors}"
            got = os.read(self.process.stdout.fileno(), 1 << 20)
            assert got, f"ended, with {self.process.wait(DEADLINE_S)}: {self.errors}"
            self._read += got
        line, _, self._read = self._read.partition(b"\n")
        return line.decode("utf-8", "surrogateescape")

    def end(self) -> None:
        """Let it end; fail where a sanitizer has found something, such as lost memory."""
        self.send("QUIT")
        assert self.process.wait(DEADLINE_S) == 0, self.errors

    def __enter__(self) -> StubKernel:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        assert self.process.stdin is not None
        try:
            if kind is None and self.process.poll() is None:
                self.end()
        finally:
            self.process.kill()
            self.process.wait(DEADLINE_S)
            self.process.stdin.close()
            assert self.process.stdout is not None
            self.process.stdout.close()
