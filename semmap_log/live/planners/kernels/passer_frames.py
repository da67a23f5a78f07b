"""What goes over the wire to OPRS's message passer (`mp-oprs`) and back; no socket.

All integers have four bytes, big-endian; a string is its length in bytes and the bytes.

    register    1 (messages come as strings), name      answer: 0 good, 1 name taken, 2 denied
    message     1, recipient, text                      type 4 alone: disconnect
    multicast   3, count, text, recipient ...
    received    sender, text
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence

from semmap_log.errors import ExpressionError, PasserError
from semmap_log.live.planners.kernels.s_expressions import Expression, is_atom, write_expression

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
    """Tell whether messages can be sent to a name without harm to the passer."""
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
