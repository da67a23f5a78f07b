"""Messages with texts and arrays <-> CDR bytes, field by field as their `.msg` texts tell.

XCDR1, little endian, as ROS 2 writes it: numbers are aligned to their own size, counted from behind
the encapsulation; a text is its length with the zero that ends it, and its bytes; an array of any
size begins with its length. The same bytes as rosbags reads and writes, which is the oracle in the
tests; here arrays are views, nothing is generated, and nothing heavy is imported: a moment of the
past wants one Keyframe, with hundreds of doors in columns, in less than a millisecond.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any, TypeAlias

import numpy as np

from semmap_log.core.lazy.lazily import computed_once
from semmap_log.core.messages.definitions import CODES, MessageField, flat_fields

CDR_HEADER = b"\x00\x01\x00\x00"
"""Representation identifier CDR_LE and no options."""

MOST_PADDING = 3
"""Bytes behind the last field, with which some writers fill up to four."""

_LENGTH = struct.Struct("<I")

Read: TypeAlias = Callable[[memoryview, int], tuple[Any, int]]
"""A field's value at a place, and where the next one begins."""
Write: TypeAlias = Callable[[bytearray, Any], None]


def read_message(ros_type: str, data: bytes | memoryview) -> dict[str, Any]:
    """Return the fields of a message: numbers, arrays, texts, lists of texts.

    Args:
        ros_type: Its type; fields of messages that it holds are called `header.stamp.sec`.
        data: Its CDR bytes; the arrays are views of them.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if bytes(data[: len(CDR_HEADER)]) != CDR_HEADER:
        raise ValueError(f"not a {ros_type}: its encapsulation is {bytes(data[:4]).hex()}")
    body = memoryview(data)[len(CDR_HEADER) :]
    values: dict[str, Any] = {}
    at: int | Texts = 0
    try:
        for name, read in _readers(ros_type):
            if read is None:
                values[name] = at = Texts(body, at)
            else:
                values[name], at = read(body, at if isinstance(at, int) else at.end)
    except (struct.error, IndexError, ValueError) as error:
        raise ValueError(f"not a {ros_type}: {error}") from error
    if isinstance(at, int) and at + MOST_PADDING < len(body):
        raise ValueError(f"not a {ros_type}: {len(body) - at} bytes behind its end")
    return values


def write_message(ros_type: str, values: Mapping[str, Any]) -> bytes:
    """Return the CDR bytes of a message.

    Args:
        ros_type: Its type.
        values: Each field's value; an array of bytes as `bytes` or numpy's.

    Raises:
        ValueError: A value is none of its field.
    """
    data = bytearray()
    name = ""
    try:
        for name, write in _writers(ros_type):  # for the message
            write(data, values[name])
    except (struct.error, AttributeError, OverflowError, TypeError, ValueError) as error:
        raise ValueError(f"{ros_type}: {name}: {error}") from error
    return CDR_HEADER + bytes(data)


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
            count, at = _read_length(body, start if isinstance(start, int) else start.end)
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


@cache
def _readers(ros_type: str) -> tuple[tuple[str, Read | None], ...]:
    """Return each field with what reads it; None: texts, which are walked when they are wanted."""
    return tuple((field.name, _reader(field)) for field in flat_fields(ros_type))


def _reader(field: MessageField) -> Read | None:
    if field.type == "string":
        return _read_text if field.count is None else None
    if field.count is None:
        return partial(_read_number, struct.Struct("<" + CODES[field.type][0]))
    return partial(_read_array, np.dtype("<" + CODES[field.type][0]), field.count)


def _read_number(packed: struct.Struct, body: memoryview, at: int) -> tuple[Any, int]:
    at += -at % packed.size
    return packed.unpack_from(body, at)[0], at + packed.size


_read_length = partial(_read_number, _LENGTH)


def _read_text(body: memoryview, at: int) -> tuple[str, int]:
    at += -at & 3
    begin = at + 4
    end = begin + int.from_bytes(body[at:begin], "little")
    if end == begin or end > len(body) or body[end - 1]:
        raise ValueError("a text that does not end")
    return str(body[begin : end - 1], "utf-8"), end


def _read_array(
    dtype: np.dtype[Any], count: int, body: memoryview, at: int
) -> tuple[np.ndarray[Any, Any], int]:
    """Read `count` numbers, or as many as stand before them if it is 0."""
    if not count:
        count, at = _read_length(body, at)
    if not count:
        return np.empty(0, dtype), at
    at += -at % dtype.itemsize
    return np.frombuffer(body, dtype, count, at), at + count * dtype.itemsize


@cache
def _writers(ros_type: str) -> tuple[tuple[str, Write], ...]:
    return tuple((field.name, _writer(field)) for field in flat_fields(ros_type))


def _writer(field: MessageField) -> Write:
    if field.type == "string":
        return _write_text if field.count is None else _write_texts
    if field.count is None:
        return partial(_write_number, struct.Struct("<" + CODES[field.type][0]))
    return partial(_write_array, np.dtype("<" + CODES[field.type][0]), field.count)


def _write_number(packed: struct.Struct, data: bytearray, value: Any) -> None:
    _align(data, packed.size)
    data += packed.pack(value)


_write_length = partial(_write_number, _LENGTH)


def _write_text(data: bytearray, text: str) -> None:
    said = text.encode()
    _write_length(data, len(said) + 1)
    data += said
    data.append(0)


def _write_texts(data: bytearray, texts: Sequence[str]) -> None:
    _write_length(data, len(texts))
    for text in texts:
        _write_text(data, text)


def _write_array(dtype: np.dtype[Any], count: int, data: bytearray, values: Any) -> None:
    is_bytes = isinstance(values, bytes)
    array = np.frombuffer(values, dtype) if is_bytes else np.asarray(values, dtype)
    if not count:
        _write_length(data, len(array))
    elif len(array) != count:
        raise ValueError(f"expected {count} elements, got {len(array)}")
    if len(array):
        _align(data, dtype.itemsize)
        data += array.tobytes()


def _align(data: bytearray, size: int) -> None:
    data += bytes(-len(data) % size)
