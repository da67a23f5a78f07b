"""Signing beside a writer: a reader of the log's folder that signs when a segment was closed.

What goes wrong in it is told once, and tried again when the next segment is closed.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from semmap_log.common.texts import command_line
from semmap_log.common.work_beside import AbandonedWork, WorkBeside
from semmap_log.signing.ed25519_sdk import SigningKey
from semmap_log.signing.log_signing import Signed, sign
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import mark_names

if TYPE_CHECKING:
    from typing_extensions import Self

LOOK_S = 1.0
"""Between two looks at the folder."""
END_S = 30.0
"""So long `close` waits for what is being signed."""
PAUSE_S = 0.0005
"""Waited between two chunks: an append that waits for the interpreter goes first."""


class SignBeside:
    """Signs a log's closed segments while somebody writes it; one more time at its end.

    with SignBeside("office", key), sl.append("office") as log:
        log.observe(door, "open")

    The order matters: the writer closes its last segment first, and that is signed then.
    """

    def __init__(
        self,
        log: str | Path,
        key: SigningKey,
        *,
        tell: Callable[[str], None] = lambda _: None,
        look_s: float = LOOK_S,
        end_s: float = END_S,
    ) -> None:
        """Take the log and the key; no thread is started yet.

        Args:
            log: The log's folder.
            key: Who signs.
            tell: Told once when it cannot be signed, and once when it can again.
            look_s: So long it waits between two looks at the folder.
            end_s: So long the end waits for what is being signed.
        """
        self._folder = LogFolder(Path(log))
        self._key = key
        self._tell = tell
        self._thread = WorkBeside("semmap_log signing", self._look, pause_s=look_s, end_s=end_s)
        self._done: str | None = None
        """Which mark of a closing was the last when all was last signed, or tried."""
        self.signed: Signed | None = None
        """What the last signing that went well has done; None: none has yet."""
        self.problem = ""
        """What keeps it from signing; empty: nothing does."""

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._thread.close()

    @property
    def is_all_signed(self) -> bool:
        """Whether the end has come, and found every closed segment signed."""
        return self._thread.is_ended and not self.problem

    def _look(self, *, is_last: bool) -> None:
        closed = self._closed()
        if closed is not None and (closed != self._done or (is_last and self.problem)):
            self._done = closed
            self._try()

    def _closed(self) -> str | None:
        """Return what changes when a segment is closed; None: none is closed."""
        with suppress(OSError):
            return next(reversed(mark_names(self._folder.names())), None)
        return None

    def _try(self) -> None:
        try:
            self.signed = sign(self._folder.absolute, self._key, progress=self._pause)
        except AbandonedWork:
            self.problem = self.problem or "there was no time"
        except Exception as error:  # noqa: BLE001 - whatever it is, the writer goes on
            self._failed(str(error) or type(error).__name__)
        else:
            if self.problem:
                self._tell(f"{self._folder.path}: signing works again.")
            self.problem = ""

    def _failed(self, problem: str) -> None:
        if not self.problem:
            line = command_line("sign", self._folder.path, "--key", "KEY")
            self._tell(
                f"not signed: {problem} Recording goes on, and this is tried again with the next "
                f"segment; later, by: {line}"
            )
        self.problem = problem

    def _pause(self, _done: int, _total: int) -> None:
        self._thread.go_on(PAUSE_S)
