"""Background signing during writing: the log's end, from time to time, as that writer wrote it.

What is signed comes from the writer's memory, not from the disk: what anybody else puts there is
not signed. A failure is reported once, and signing is tried again the next time.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from semmap_log.core.io.background_task import AbandonedWork, BackgroundTask
from semmap_log.core.model.commits import Durability
from semmap_log.core.texts import command_line
from semmap_log.errors import SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import LogSigning, reach_at, read_for_signing, unwritten
from semmap_log.log.signing.signer_state import Reach, Signer, SignerState
from semmap_log.log.signing.statement import Statement
from semmap_log.store.byte_layout import mark_names
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.reader import LogReader

if TYPE_CHECKING:
    from typing_extensions import Self

    from semmap_log.store.writing.writer import LogWriter, Written

EVERY_S = 60.0
"""Between two signatures of the log's end."""
END_S = 30.0
"""So long `close` waits for what is being signed."""
PAUSE_S = 0.0005
"""Waited between two chunks: an append that waits for the interpreter goes first."""


class BackgroundSigner:
    """Signs the end of a log while it is written, and once more when it is closed.

    with BackgroundSigner("office", key) as signer, sl.append("office", signer=signer) as log:
        log.observe(door, "open")

    The order matters: the writer closes its last segment first, and that is signed then. The
    statement of each time takes the place of the one before, but for those that come first after a
    segment was closed: these stay.
    """

    def __init__(
        self,
        log: str | Path,
        key: SigningKey,
        *,
        adopt: bool = False,
        tell: Callable[[str], None] = lambda _: None,
        every_s: float = EVERY_S,
        end_s: float = END_S,
    ) -> None:
        """Take the log and the key; the thread is started with the writer.

        Args:
            log: The log's folder.
            key: Who signs.
            adopt: Sign also what is found there, unsigned and not written with this key; each
                statement about it says so.
            tell: Called once when it cannot be signed, and once when it can again.
            every_s: So long it waits between two signatures.
            end_s: So long the end waits for what is being signed.
        """
        self._folder = LogFolder(Path(log))
        self._key = key
        self._adopt = adopt
        self._tell = tell
        self._thread = BackgroundTask(
            "semmap_log signing", self._look, pause_s=every_s, end_s=end_s
        )
        self._sessions: list[_Session] = []
        """One for each writer that it was given; the last one is active."""
        self._marks: str | None = None
        """Which mark of a closing was the last when a statement was last kept."""
        self.signed_before = 0
        """Events below this number are signed."""
        self.problem = ""
        """What keeps it from signing; empty: nothing does."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._thread.close()

    def follow(self, writer: LogWriter) -> None:
        """Sign what this writer appends from now on; before it appends anything."""
        session = _Session(writer)
        if self._sessions:
            session.continues_from(self._sessions[-1])
        self._sessions.append(session)
        if len(self._sessions) == 1:
            self._thread.start()

    @property
    def is_all_signed(self) -> bool:
        """Whether the end has come, and found all signed that was written."""
        return not self._sessions or (self._thread.is_ended and not self.problem)

    def _look(self, *, is_last: bool) -> None:
        try:
            self._sign(self._sessions[-1], is_last=is_last)
        except AbandonedWork:
            self.problem = self.problem or "there was no time"
        except Exception as error:  # noqa: BLE001 - whatever it is, the writer goes on
            self._failed(str(error) or type(error).__name__)
        else:
            if self.problem:
                self._tell(f"{self._folder.path}: signing works again.")
            self.problem = ""

    def _sign(self, session: _Session, *, is_last: bool) -> None:
        end = session.durable_end()
        log = self._folder.absolute
        with SignerState.held(self._key) as state:
            if session.base is None and not self._begin(session, end, state):
                return
            signer = Signer(log, session.log_id, self._key, state)
            if signer.last is None or end is None:
                return
            signed = signer.last.statement.next_event
            if signed > end.next_event:
                raise SigningError(f"{log}: this key has signed more than is written, to {signed}.")
            marks = self._last_mark()
            keep = is_last or marks != self._marks
            if signed < end.next_event or (keep and not signer.last.is_kept):
                signer.put(session.reach(end), keep=keep)
                self._marks = marks if keep else self._marks
            self.signed_before = end.next_event

    def _begin(self, session: _Session, end: Written | None, state: SignerState) -> bool:
        """Find what the log holds where its writer came; sign that, if it may be.

        Returns:
            False: nothing can be signed before more is written.

        Raises:
            SigningError: Somebody else has written to it since it was signed last.
        """
        log, start = self._folder.absolute, session.start
        session.log_id = LogReader(log).info.log_id
        signer = Signer(log, session.log_id, self._key, state)
        last = None if signer.last is None else signer.last.statement
        here = start.next_event, start.head.hex()
        if not session.begins_segment and last is not None and here == (last.next_event, last.head):
            taken = bytes.fromhex(last.taken)
            session.base = Reach(start.next_event, start.head, last.commits, taken)
            return True
        if session.begins_segment:  # with a keyframe, which is signed once it is there
            if end is None or not end.commits:
                return False
            start = end
        base = signer.base
        signed = 0 if base is None else base.next_event
        is_known = signed >= session.start.next_event or (base is None and not signer.is_lost)
        is_known = is_known or not isinstance(base, Statement | None)
        if not (is_known or self._adopt):
            raise unwritten(log, signed, session.start.next_event - 1)
        found = read_for_signing(log, state, self._pause, at=start.next_event)
        if not self._adopt:
            LogSigning(log, found, signer).check()
        there = found.ends.get(start.next_event)
        if there is None or there.head != start.head:
            raise SigningError(f"{log}: its files differ from what was written.")
        try:
            session.base = reach_at(found, start.next_event, last)
        except ValueError:
            raise SigningError(f"{log}: its beginning is stored elsewhere only.") from None
        signer.take_up()
        adopted = None if is_known else (signed, session.start.next_event - 1)
        session.base_commits = start.commits
        if signed < start.next_event:
            signer.put(session.base, adopted=adopted)
        return True

    def _last_mark(self) -> str | None:
        """Return what changes when a segment is closed; None: none is closed."""
        with suppress(OSError):
            return next(reversed(mark_names(self._folder.names())), None)
        return None

    def _failed(self, problem: str) -> None:
        if not self.problem:
            line = command_line("sign", self._folder.path, "--key", "KEY")
            self._tell(
                f"not signed: {problem} Recording continues, and signing is retried later. Once "
                f"the log is closed, you can also run: {line}"
            )
        self.problem = problem

    def _pause(self, _done: int, _total: int) -> None:
        self._thread.proceed(PAUSE_S)


class _Session:
    """What one writer wrote, and from where on."""

    def __init__(self, writer: LogWriter) -> None:
        self._writer = writer
        self.start: Written = writer.written
        self.begins_segment = writer.begins_segment
        self.log_id = ""
        self.base: Reach | None = None
        """What the log held at some point of the session; None: not known yet."""
        self.base_commits = 0
        """How many commits the writer had appended then."""

    def continues_from(self, before: _Session) -> None:
        """Take over what is known, if this writer begins where that one has ended."""
        ended, start = before._writer.written, self.start
        is_next = (ended.next_event, ended.head) == (start.next_event, start.head)
        if before.base is not None and is_next and not self.begins_segment:
            self.log_id, self.base = before.log_id, before.reach(ended)

    def durable_end(self) -> Written | None:
        """Return how far the writer has come, once that survives a power cut; None: not known."""
        writer, end = self._writer, self._writer.written
        if writer.policy.level is not Durability.NONE:
            writer.make_durable(end.next_event)
        return end if end.next_event <= writer.durable_before else None

    def reach(self, end: Written) -> Reach:
        """Return what the log holds up to an end of this session."""
        assert self.base is not None, "it was found before"
        commits = self.base.commits + end.commits - self.base_commits
        return Reach(end.next_event, end.head, commits, self.base.taken)
