"""Messages with arrays and texts, read in place: a Keyframe is hundreds of doors in columns.

The same bytes as rosbags reads (`typestore`), which is the oracle in the tests; here arrays are
views, nothing is generated, and nothing heavy is imported: a moment of the past wants one of
these messages, and wants it in less than a millisecond.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from semmap_log.common.lazily import computed_once
from semmap_log.messages.layout import CDR_HEADER, CODES, message_text

_FIELD = re.compile(r"^(?P<type>\w+)(?P<array>\[(?P<count>\d*)\])? (?P<name>\w+)\s*(#.*)?$")
_LENGTH = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class _Field:
    """A line of a `.msg` text."""

    name: str
    dtype: np.dtype[Any] | None
    """None: texts."""
    is_array: bool
    count: int | None
    """Of an array of fixed size."""


def read_in_place(message: str, data: bytes | memoryview) -> dict[str, Any]:
    """Return the fields of one of our messages: numbers, views of arrays, texts, lists of texts.

    Args:
        message: Its name, such as `Keyframe`.
        data: Its CDR bytes; the arrays are views of them.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if bytes(data[: len(CDR_HEADER)]) != CDR_HEADER:
        raise ValueError(f"not a {message}: its encapsulation is {bytes(data[:4]).hex()}")
    body = memoryview(data)[len(CDR_HEADER) :]
    values: dict[str, Any] = {}
    at: int | Texts = 0
    try:
        for field in _fields(message):
            if field.is_array and field.dtype is None:
                values[field.name] = at = Texts(body, at)
            else:
                values[field.name], at = _read(field, body, at if isinstance(at, int) else at.end)
    except (struct.error, ValueError) as error:
        raise ValueError(f"not a {message}: {error}") from error
    return values


class Texts(Sequence[str]):
    """An array of texts; walked when one is asked for, or what lies behind it.

    The first use raises ValueError if these bytes are none.
    """

    def __init__(self, body: memoryview, start: int | Texts) -> None:
        """Take note of where they are.

        Args:
            body: The message without its encapsulation.
            start: Where they begin; or what they lie behind.
        """
        self._body = body
        self._start = start

    def __getitem__(self, i: Any) -> Any:
        return self._walked[0][i]

    def __len__(self) -> int:
        return len(self._walked[0])

    @property
    def end(self) -> int:
        """Where the next field begins."""
        return self._walked[1]

    @computed_once
    def _walked(self) -> tuple[list[str], int]:
        body, start = self._body, self._start
        texts = []
        try:
            count, at = _length(body, start if isinstance(start, int) else start.end)
            for _ in range(count):  # inline: a map of 500 doors has a thousand texts
                at += -at & 3
                begin = at + 4
                at = begin + int.from_bytes(body[at:begin], "little")
                texts.append(str(body[begin : at - 1], "utf-8"))
                if body[at - 1]:
                    raise ValueError("a text that does not end")
        except (IndexError, struct.error):
            raise ValueError("texts that reach beyond the end") from None
        return texts, at


def texts_in(data: bytes, start: int, count: int) -> list[str]:
    """Return texts that follow each other in a message, in a tenth of the time of all its fields.

    Args:
        data: The message's CDR bytes.
        start: Where the first one begins in them.
        count: How many.

    Raises:
        ValueError: There are not so many.
    """
    texts, at = [], start
    for _ in range(count):
        at += -at & 3
        end = at + 4 + int.from_bytes(data[at : at + 4], "little")
        if end == at + 4 or end > len(data) or data[end - 1]:
            raise ValueError(f"a text at byte {at} that does not end")
        texts.append(data[at + 4 : end - 1].decode())
        at = end
    return texts


@cache
def _fields(message: str) -> tuple[_Field, ...]:
    fields = []
    for line in message_text(message).splitlines():
        match = _FIELD.match(line)
        if match:
            is_text = match["type"] == "string"
            dtype = None if is_text else np.dtype("<" + CODES[match["type"]][0])
            count = int(match["count"]) if match["count"] else None
            fields.append(_Field(match["name"], dtype, match["array"] is not None, count))
    return tuple(fields)


def _read(field: _Field, body: memoryview, at: int) -> tuple[Any, int]:
    """Return a field's value, and where the next one begins."""
    if not field.is_array:
        return _text(body, at) if field.dtype is None else _number(field.dtype, body, at)
    count = field.count
    if count is None:
        count, at = _length(body, at)
    assert field.dtype is not None, "texts are read elsewhere"
    if not count:
        return np.empty(0, field.dtype), at
    at += -at % field.dtype.itemsize
    end = at + count * field.dtype.itemsize
    if end > len(body):
        raise ValueError(f"{field.name} has {count} elements, beyond the end")
    return np.frombuffer(body, field.dtype, count, at), end


def _number(dtype: np.dtype[Any], body: memoryview, at: int) -> tuple[Any, int]:
    at += -at % dtype.itemsize
    return np.frombuffer(body, dtype, 1, at)[0].item(), at + dtype.itemsize


def _length(body: memoryview, at: int) -> tuple[int, int]:
    at += -at % _LENGTH.size
    return _LENGTH.unpack_from(body, at)[0], at + _LENGTH.size


def _text(body: memoryview, at: int) -> tuple[str, int]:
    length, at = _length(body, at)
    end = at + length
    if not length or end > len(body) or body[end - 1]:
        raise ValueError("a text that does not end")
    return str(body[at : end - 1], "utf-8"), end
