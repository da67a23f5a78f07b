"""The doors in kernels' databases, over a message passer that may come and go.

A kernel gets all facts when it is there: when the passer is, when it has come itself, and when it
asks for them by `(DOOR_FACTS)`. After that it gets what changes. Passer and kernels are tried again
for ever; nobody waits for them.
"""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from semmap_log.oprs.expressions import Expression, ExpressionError, Symbol, Term, read
from semmap_log.oprs.message_passer import PASSER, Message, PasserClient, PasserError

ASK, ANSWER, ERROR, ALL_FACTS = map(Symbol, ("ASK", "ANSWER", "ERROR", "DOOR_FACTS"))
UNKNOWN, TRIED = Symbol("unknown"), Symbol("SEMMAP_TRIED")

RETRY_S = 1.0
"""Between two looks for a passer, or for a kernel that is missing."""


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """What a link tells, to whom, and whom it asks.

    A kernel asks `(ASK 17 (DOOR_OPEN DOOR_3))` and gets `(ANSWER 17 T)`, or, where that is no
    question, `(ANSWER 17 ERROR "why")`.
    """

    name: str
    """Ours, under which others send to us."""
    recipients: Sequence[str]
    """The kernels that get facts; others may ask all the same."""
    all_facts: Callable[[], list[Expression]]
    """Tells the doors as they are."""
    answer: Callable[[Expression], Term]
    """Answers a question; what it raises as ExpressionError is told to who asked. While it does,
    everybody else waits."""
    say: Callable[[str], None]
    """LinkSettings, in words, who is there and who is missing."""


class PasserLink:
    """Keeps kernels informed, and answers them; `run` does so until `stop`.

    Args:
        connect: Registers with the passer.
        settings: What it tells, to whom.
        retry_s: Between two looks for the passer, or for a kernel that is missing.
    """

    def __init__(
        self,
        connect: Callable[[], PasserClient],
        settings: LinkSettings,
        *,
        retry_s: float = RETRY_S,
    ) -> None:
        self._connect = connect
        self._settings = settings
        self._retry_s = retry_s
        self._changes = _Changes()
        self._stopped = threading.Event()

    def post(self, changed: list[Expression]) -> None:
        """Tell the kernels what has changed; any thread may, and waits for nothing."""
        if changed:
            self._changes.put(changed)

    def stop(self) -> None:
        """Let `run` end."""
        self._stopped.set()
        self._changes.wake()

    def run(self) -> None:
        """Connect, tell, answer; again and again, until `stop`."""
        said = ""
        while not self._stopped.is_set():
            problem = self._run_once()
            if problem and problem != said:
                self._settings.say(f"{problem} It is tried again.")
            said = problem
            self._stopped.wait(self._retry_s)
        self._changes.close()

    def _run_once(self) -> str:
        """Connect, tell and answer until the passer is gone; return why it is, "": stopped."""
        try:
            with self._connect() as client:
                _Session(client, self._settings, self._changes).run(self._stopped, self._retry_s)
        except PasserError as error:
            return str(error)
        return ""


class _Changes:
    """Facts that wait to be sent; `select` wakes up when some do."""

    def __init__(self) -> None:
        self._waiting: deque[list[Expression]] = deque()
        self._woken, self._waker = socket.socketpair()
        self._woken.setblocking(False)
        self._waker.setblocking(False)

    def fileno(self) -> int:
        return self._woken.fileno()

    def put(self, facts: list[Expression]) -> None:
        self._waiting.append(facts)
        self.wake()

    def wake(self) -> None:
        try:
            self._waker.send(b"!")
        except OSError:  # full: it is awake already; or closed: nobody sleeps any more
            return

    def take(self) -> list[Expression]:
        """Return all that wait, in order."""
        with contextlib.suppress(BlockingIOError):
            self._woken.recv(4096)
        facts: list[Expression] = []
        while self._waiting:
            facts += self._waiting.popleft()
        return facts

    def close(self) -> None:
        self._woken.close()
        self._waker.close()


class _Session:
    """One registration with a passer, and who is there meanwhile."""

    def __init__(self, client: PasserClient, settings: LinkSettings, changes: _Changes) -> None:
        self._client = client
        self._settings = settings
        self._changes = changes
        self._missing: set[str] = set()
        self._tried: set[str] = set()
        """Missing ones to whom something was sent: they are there, unless the passer says no."""
        self._trial = 0

    def run(self, stopped: threading.Event, retry_s: float) -> None:
        """Tell and answer until it is stopped.

        Raises:
            PasserError: The passer is gone.
        """
        settings = self._settings
        to_whom = ", ".join(settings.recipients) or "nobody"
        settings.say(f"{settings.name} is registered; facts go to {to_whom}.")
        self._changes.take()  # older than the facts that follow
        self._tell(settings.recipients, settings.all_facts())
        next_trial = time.monotonic() + retry_s
        while not stopped.is_set():
            sources = [self._client.fileno(), self._changes.fileno()]
            ready, _, _ = select.select(sources, [], [], retry_s)
            if self._changes.fileno() in ready:
                there = [name for name in settings.recipients if name not in self._missing]
                self._tell(there, self._changes.take())
            while (message := self._client.receive(0.0)) is not None:
                self._take(message)
            if time.monotonic() >= next_trial:
                self._try_missing()
                next_trial = time.monotonic() + retry_s

    def _tell(self, names: Iterable[str], facts: Sequence[Expression]) -> None:
        for name in names:
            for fact in facts:
                self._client.send(name, fact)

    def _try_missing(self) -> None:
        """Send those that are missing a fact each, and then ourselves a word.

        The passer keeps the order: when that word comes, it has said who is not there.
        """
        facts = self._settings.all_facts() if self._missing else []
        if facts:
            self._tried = set(self._missing)
            self._tell(sorted(self._tried), facts[:1])
            self._trial += 1
            self._client.send(self._settings.name, Expression(TRIED, (self._trial,)))

    def _take(self, message: Message) -> None:
        try:
            said = read(message.text)
        except ExpressionError as error:
            self._settings.say(f"{message.sender}: sent what is no expression: {error}")
            return
        match said:
            case Expression(name, (Symbol() as who,)) if (
                name == UNKNOWN and message.sender == PASSER
            ):
                self._is_missing(who)
            case Expression(name, (trial,)) if (
                name == TRIED and message.sender == self._settings.name
            ):
                if trial == self._trial:
                    self._are_there()
            case Expression(name, ()) if name == ALL_FACTS:
                self._tell([message.sender], self._settings.all_facts())
            case Expression(name, (ask_id, Expression() as question)) if name == ASK:
                self._client.send(message.sender, self._answer(ask_id, question))
            case _:
                self._settings.say(
                    f"{message.sender}: expected (ASK ID (QUESTION …)), got another."
                )

    def _is_missing(self, name: str) -> None:
        self._tried.discard(name)
        if name in self._settings.recipients and name not in self._missing:
            self._missing.add(name)
            self._settings.say(f"{name}: is not there; it is told all when it is.")

    def _are_there(self) -> None:
        there, self._tried = sorted(self._tried), set()
        self._missing -= set(there)
        for name in there:
            self._settings.say(f"{name}: is there now.")
            self._tell([name], self._settings.all_facts())

    def _answer(self, ask_id: Term, question: Expression) -> Expression:
        try:
            return Expression(ANSWER, (ask_id, self._settings.answer(question)))
        except ExpressionError as error:
            return Expression(ANSWER, (ask_id, ERROR, str(error)))
