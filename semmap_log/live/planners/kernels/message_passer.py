"""The connection to OPRS's message passer (`mp-oprs`), its frames, and the facts sent to kernels.

All integers have four bytes, big-endian; a string is its length in bytes and the bytes.

    register    1 (messages come as strings), name      answer: 0 good, 1 name taken, 2 denied
    message     1, recipient, text                      type 4 alone: disconnect
    multicast   3, count, text, recipient ...
    received    sender, text

The connection never keeps the passer waiting: the passer has one thread, and stands still for all
its kernels while a client does not take what it is given, or sends half of something. So incoming
bytes are always read, and what goes out is whole messages, of which the system gets as much as it
takes.

The passer does not report who comes or goes. It answers `(unknown K1)` to whoever sends to a K1
that is not there, and does all in order. So we send `(DOOR_MAP SEMMAP)` to a kernel, and a message
to ourselves: if that is back and no `(unknown K1)` came, the kernel is there, and all facts are
sent.

    (DOOR_STATE DOOR_3 OPEN)           or CLOSED UNKNOWN MOVING OFFLINE, or REMOVED
    (DOOR_PROBABILITY DOOR_3 0.75)     its P(open) in the map; NIL: it has none any more
    (DOOR_NAME DOOR_3 "main door")     NIL: it has none any more
    (DOOR_MAP SEMMAP)                  all facts follow, if they were not requested
    (DOOR_FACTS SEMMAP 5)              all facts of five doors have been sent, by SEMMAP

A door has a fact of each kind at most: `declare ff` in a kernel lets the new one replace the old.
"""

from __future__ import annotations

import contextlib
import math
import re
import select
import socket
import struct
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.errors import ExpressionError, PasserError
from semmap_log.live.planners.addresses import TcpAddress, reason_of
from semmap_log.live.planners.door_view import atom_of, atom_of_state
from semmap_log.live.planners.kernels.s_expressions import (
    Expression,
    is_atom,
    sendable,
    write_expression,
)
from semmap_log.live.planners.question_lines import NIL, Atom
from semmap_log.live.ros.serving.served_topics import ChangedDoors

CONNECT_S = 5.0
CLOSE_S = 1.0
_AT_ONCE = 2**18


class PasserConnection:
    """Sends and receives messages under a name."""

    def __init__(self, address: TcpAddress, name: str, *, timeout_s: float = CONNECT_S) -> None:
        """Register.

        Args:
            address: Where the passer listens.
            name: Ours.
            timeout_s: How long to wait for it.

        Raises:
            PasserError: It is not there, does not answer, or has another client of that name.
        """
        first = registration(name)
        try:
            self.socket = socket.create_connection((address.host, address.port), timeout_s)
        except (OSError, UnicodeError) as error:
            reason = reason_of(error)
            raise PasserError(f"no message passer at {_said(address)}: {reason}.") from error
        self._received = MessageReader()
        self._out = bytearray()
        try:
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.socket.sendall(first)
            self._check(self._answer(time.monotonic() + timeout_s), address, name)
            self.socket.setblocking(False)
        except OSError as error:
            self.socket.close()
            if isinstance(error, PasserError):
                raise
            raise PasserError(f"the message passer at {_said(address)} left: {error}.") from error

    @property
    def waiting_bytes(self) -> int:
        """How much was put and not yet taken by the passer."""
        return len(self._out)

    def put(self, frame: bytes) -> None:
        """Have a message sent by the next calls of `send`."""
        self._out += frame

    def send(self) -> None:
        """Send what the passer takes now.

        Raises:
            PasserError: It has gone.
        """
        try:
            while self._out:
                with memoryview(self._out)[:_AT_ONCE] as piece:
                    sent = self.socket.send(piece)
                del self._out[:sent]
        except BlockingIOError:
            pass
        except OSError as error:
            raise PasserError(f"the message passer has gone: {error}.") from error

    def receive(self) -> list[tuple[bytes, bytes]]:
        """Return the sender and the text of each message that has come as a whole.

        Raises:
            PasserError: It has gone, or is no message passer.
        """
        try:
            data = self.socket.recv(_AT_ONCE)
        except BlockingIOError:
            return []
        except OSError as error:
            raise PasserError(f"the message passer has gone: {error}.") from error
        if not data:
            raise PasserError("the message passer has gone.")
        self._received.take(data)
        return self._received.messages()

    def close(self) -> None:
        """Leave: say so to the passer, and read what it still sends until it disconnects."""
        end_s = time.monotonic() + CLOSE_S
        with contextlib.suppress(OSError):
            self.put(goodbye())
            while (left_s := end_s - time.monotonic()) > 0:
                writes = [self.socket] if self._out else []
                can_read, can_write, _ = select.select([self.socket], writes, [], left_s)
                if can_write:
                    self.send()
                if can_read and not self.socket.recv(_AT_ONCE):
                    break
        self.socket.close()

    def _answer(self, end_s: float) -> int:
        while (answer := self._received.registered()) is None:
            self.socket.settimeout(max(end_s - time.monotonic(), 0.001))
            data = self.socket.recv(_AT_ONCE)
            if not data:
                raise PasserError("the message passer left without an answer.")
            self._received.take(data)
        return answer

    def _check(self, answer: int, address: TcpAddress, name: str) -> None:
        if answer == NAME_TAKEN:
            raise PasserError(
                f"the message passer at {_said(address)} has another client called {name}: it must "
                "leave, or --oprs-name give another name."
            )
        if answer != REGISTERED:
            raise PasserError(
                f"the message passer at {_said(address)} does not let {name} in: it answered "
                f"{answer}, expected {REGISTERED}."
            )


def _said(address: TcpAddress) -> str:
    return str(address).removeprefix("tcp:")


FIRST_PAUSE_S = 0.5
LONGEST_PAUSE_S = 5.0

ECHO = Atom("SEMMAP_ECHO")
"""First word of what we send to ourselves."""


@dataclass(slots=True)
class _Kernel:
    """One that is to receive the doors."""

    is_present: bool = False
    echo: int | None = None
    """The message to ourselves after whose return it is there; None: it was not called."""
    next_call_s: float = 0.0
    pause_s: float = FIRST_PAUSE_S


class ToldKernels:
    """Sends the doors to kernels, over one connection."""

    def __init__(self, name: str, kernels: Iterable[str], put: Callable[[bytes], object]) -> None:
        """Know none of them to be there.

        Args:
            name: Ours.
            kernels: The recipients.
            put: Sends a frame.
        """
        self._name = name
        self._put = put
        self._facts = DoorFacts()
        self._kernels = {kernel: _Kernel() for kernel in kernels}
        self._echoes = 0

    def take(self, doors: DoorMap) -> None:
        """Send what is new to all kernels that are there."""
        news = self._facts.take(doors)
        present = [name for name, kernel in self._kernels.items() if kernel.is_present]
        if present:
            self._send(present, news)

    def call(self, now_s: float) -> None:
        """Call those that may be there by now."""
        called = False
        for name, kernel in self._kernels.items():
            if kernel.is_present or kernel.echo is not None or kernel.next_call_s > now_s:
                continue
            self._send([name], [(Atom("DOOR_MAP"), Atom(self._name))])
            kernel.echo = self._echoes + 1
            kernel.next_call_s = now_s + kernel.pause_s
            kernel.pause_s = min(2 * kernel.pause_s, LONGEST_PAUSE_S)
            called = True
        if called:
            self.echo()

    def echo(self) -> None:
        """Send ourselves a message."""
        self._echoes += 1
        self._send([self._name], [(ECHO, self._echoes)])

    def returned(self, echo: Expression) -> None:
        """Hear a message to ourselves: kernels that were called before it are there."""
        for name, kernel in self._kernels.items():
            if kernel.echo is not None and kernel.echo == echo:
                self.tell_all(name)

    def is_unknown(self, name: str, now_s: float) -> None:
        """Hear that a kernel is not there: it is called again later."""
        kernel = self._kernels.get(name)
        if kernel is not None:
            kernel.is_present, kernel.echo = False, None
            kernel.next_call_s = max(kernel.next_call_s, now_s + FIRST_PAUSE_S)

    def is_there(self, name: str) -> None:
        """Note that a kernel has sent something: call it at once."""
        kernel = self._kernels.get(name)
        if kernel is not None and not kernel.is_present:
            kernel.next_call_s = 0.0

    def tell_all(self, name: str) -> None:
        """Send all facts to a kernel that is there, and that these were all."""
        if (kernel := self._kernels.get(name)) is not None:
            kernel.is_present, kernel.echo, kernel.pause_s = True, None, FIRST_PAUSE_S
        self._send([name], [*self._facts.all(), self._facts.complete(self._name)])

    @property
    def next_call_s(self) -> float | None:
        """When one is to be called; None: all are there."""
        absent = [
            kernel.next_call_s
            for kernel in self._kernels.values()
            if not kernel.is_present and kernel.echo is None
        ]
        return min(absent, default=None)

    def _send(self, names: Sequence[str], facts: Iterable[Fact]) -> None:
        for fact in facts:
            self._put(message(names, fact))


STRINGS = 1
MESSAGE, MULTICAST, DISCONNECT = 1, 3, 4
REGISTERED, NAME_TAKEN = 0, 1

PASSER = "mp-oprs"
"""Sender of what the passer itself has to say: `(unknown NAME)`."""

MOST_NAME_BYTES = 64
"""The passer writes `(unknown NAME)` into 100 bytes, whatever the name: a longer one kills it."""
MOST_MESSAGE_BYTES = 2**20

_NOT_OURS = frozenset((PASSER, "kill-mp", "oprs-server", "ope"))
"""Names that mean something to the passer; `kill-mp` ends it."""

_INT = struct.Struct(">i")


def is_name(name: str) -> bool:
    """Return whether messages can be sent to a name without harm to the passer."""
    return 0 < len(name.encode(errors="replace")) <= MOST_NAME_BYTES and name.isprintable()


def check_own_name(name: str) -> None:
    """Refuse a name that cannot be ours: kernels read it before each of our messages.

    Raises:
        PasserError: It cannot be.
    """
    if not (is_atom(name) and is_name(name)) or name in _NOT_OURS:
        raise PasserError(
            f"{name!r} cannot be a name at the message passer: expected at most "
            f"{MOST_NAME_BYTES} letters, digits, _ and -, a letter first, such as SEMMAP."
        )


def registration(name: str) -> bytes:
    """Return what makes us known.

    Raises:
        PasserError: By such a name we cannot be.
    """
    check_own_name(name)
    return _INT.pack(STRINGS) + _string(name.encode())


def message(recipients: Sequence[str], expression: tuple[Expression, ...]) -> bytes:
    """Return what sends an expression to one recipient or several.

    Raises:
        ExpressionError: It cannot be sent.
        PasserError: A recipient would harm the passer.
    """
    for name in recipients:
        if not is_name(name):
            raise PasserError(
                f"nothing is sent to {name[:100]!r}: expected a name of 1 to {MOST_NAME_BYTES} "
                "visible characters."
            )
    text = write_expression(expression).encode()
    if len(text) > MOST_MESSAGE_BYTES:
        raise ExpressionError(f"expected at most {MOST_MESSAGE_BYTES:,} bytes, got {len(text):,}.")
    names = [_string(name.encode()) for name in recipients]
    if len(names) == 1:
        return _INT.pack(MESSAGE) + names[0] + _string(text)
    return _INT.pack(MULTICAST) + _INT.pack(len(names)) + _string(text) + b"".join(names)


def goodbye() -> bytes:
    """Return what ends the connection from our side."""
    return _INT.pack(DISCONNECT)


class MessageReader:
    """Makes messages of bytes as they come, in whatever pieces."""

    def __init__(self) -> None:
        self._data = bytearray()

    def take(self, data: bytes) -> None:
        """Take what has come."""
        self._data += data

    def registered(self) -> int | None:
        """Return the answer to our registration, before all messages; None: it is not whole."""
        if len(self._data) < _INT.size:
            return None
        (answer,) = _INT.unpack_from(self._data)
        del self._data[: _INT.size]
        return int(answer)

    def messages(self) -> list[tuple[bytes, bytes]]:
        """Return the sender and the text of each message that is whole.

        Raises:
            PasserError: This is no message passer.
        """
        found, at = [], 0
        while (end_of_name := self._end(at)) is not None:
            if (end := self._end(end_of_name)) is None:
                break
            sender = bytes(self._data[at + _INT.size : end_of_name])
            found.append((sender, bytes(self._data[end_of_name + _INT.size : end])))
            at = end
        del self._data[:at]
        return found

    def _end(self, at: int) -> int | None:
        """Return where the string ends that begins there; None: it has not come as a whole."""
        if len(self._data) < at + _INT.size:
            return None
        (length,) = _INT.unpack_from(self._data, at)
        if not 0 <= length <= MOST_RECEIVED_BYTES:
            raise PasserError(f"a message of {length:,} bytes came: this is no message passer.")
        end: int = at + _INT.size + length
        return end if end <= len(self._data) else None


MOST_RECEIVED_BYTES = 2**24
"""A kernel may send long ones; what is longer is no message."""


def unknown_name(text: bytes) -> str | None:
    """Return the name that the passer says it does not know; None: it says something else."""
    found = _UNKNOWN.fullmatch(text)
    return None if found is None else found[1].decode(errors="replace")


_UNKNOWN = re.compile(rb"\(unknown (.*)\)\n?", re.DOTALL)


def _string(data: bytes) -> bytes:
    return _INT.pack(len(data)) + data


Fact: TypeAlias = tuple[Expression, ...]

STATE, PROBABILITY, NAME = Atom("DOOR_STATE"), Atom("DOOR_PROBABILITY"), Atom("DOOR_NAME")
REMOVED = Atom("REMOVED")


class DoorFacts:
    """The facts of all doors, as they were sent last."""

    def __init__(self) -> None:
        self._changes = ChangedDoors()
        self._told: dict[DoorId, dict[Atom, Expression]] = {}

    def take(self, doors: DoorMap) -> list[Fact]:
        """Return the facts that are new or other than before; the first time, all."""
        news: list[Fact] = []
        for door_id, door in self._changes.take(doors).items():
            before = self._told.pop(door_id, {})
            now = {} if door is None else _facts(door)
            if door is not None:
                self._told[door_id] = now
            gone = {kind: REMOVED if kind is STATE else Atom(NIL) for kind in before}
            news += [
                (kind, atom_of(door_id), value)
                for kind, value in (gone | now).items()
                if kind not in before or before[kind] != value
            ]
        return news

    def all(self) -> list[Fact]:
        """Return all facts, ids ascending."""
        return [
            (kind, atom_of(door_id), value)
            for door_id in sorted(self._told)
            for kind, value in self._told[door_id].items()
        ]

    def complete(self, name: str) -> Fact:
        """Return the fact that all were sent.

        Args:
            name: The sender's.
        """
        return Atom("DOOR_FACTS"), Atom(name), len(self._told)


def _facts(door: Door) -> dict[Atom, Expression]:
    facts: dict[Atom, Expression] = {STATE: atom_of_state(door)}
    if not math.isnan(door.prob_open):
        facts[PROBABILITY] = door.prob_open
    if door.name:
        facts[NAME] = sendable(door.name)
    return facts
