"""Asks the oracle: a program of its own, which shares no code with the log it judges."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing_extensions import Self

PROGRAM = Path(__file__).parent / "oracle"


class Oracle:
    """The oracle's process, to be asked about many logs, one after the other."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def ask(self, log: Path, *moments: dict[str, int]) -> dict[str, Any]:
        """Return what the bytes of a log say, and its doors at some moments.

        Args:
            log: Its folder.
            moments: Each an `at`, a `known_at`, an `event`, some of them, or none: now.

        Raises:
            RuntimeError: The oracle itself has failed.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        request = {"log": str(log), "moments": moments}
        self._process.stdin.write(json.dumps(request).encode() + b"\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the oracle ended: {self._process.wait()}")
        found: dict[str, Any] = json.loads(answer)
        return found

    def close(self) -> None:
        """End it."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.wait()
