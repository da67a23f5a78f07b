"""CDR bytes read by the text of their message, which every segment carries as a schema."""

from __future__ import annotations

import re
import struct
from functools import cache
from typing import Any

_CODES = {
    "bool": "?", "uint8": "B", "int8": "b", "byte": "B", "char": "B",
    "uint16": "H", "int16": "h", "uint32": "I", "int32": "i", "uint64": "Q", "int64": "q",
    "float32": "f", "float64": "d",
}  # fmt: skip
_FIELD = re.compile(r"^(?P<type>[\w/]+)(?P<array>\[(?P<count>\d*)\])?\s+(?P<name>\w+)$")
_HEAD = 4
"""Bytes of encapsulation: fields are aligned from behind them."""


@cache
def _definitions(whole: str) -> dict[str, tuple[tuple[str, str | None, str], ...]]:
    """Return message name -> (type, count or "" or None, name) of its fields; "": the first."""
    found = {}
    for i, part in enumerate(re.split(r"^=+$", whole, flags=re.MULTILINE)):
        lines = [line.split("#")[0].strip() for line in part.splitlines()]
        name = next((line[4:].strip() for line in lines if line.startswith("MSG:")), "")
        matches = [_FIELD.match(line) for line in lines if "=" not in line]
        fields = tuple((m["type"], m["count"], m["name"]) for m in matches if m)
        found["" if i == 0 else name.rpartition("/")[2]] = fields
    return found


class Cdr:
    """A message's bytes, read from the front."""

    def __init__(self, data: bytes) -> None:
        if data[:2] != b"\x00\x01":
            raise ValueError(f"an encapsulation {data[:4].hex()}")
        self._body = data[_HEAD:]
        self._at = 0

    def message(self, schema: str, name: str = "") -> dict[str, Any]:
        """Return the fields of a message."""
        fields = _definitions(schema)[name]
        return {field: self._field(schema, kind, count) for kind, count, field in fields}

    def _field(self, schema: str, kind: str, count: str | None) -> Any:
        if count is None:
            return self._one(schema, kind)
        number = int(count) if count else self._number("I")
        if kind in _CODES and number:
            return self._block(_CODES[kind], number)
        return [self._one(schema, kind) for _ in range(number)]

    def _one(self, schema: str, kind: str) -> Any:
        if kind in _CODES:
            return self._number(_CODES[kind])
        if kind == "string":
            length = self._number("I")
            self._at += length
            return self._body[self._at - length : self._at - 1].decode()
        return self.message(schema, kind.rpartition("/")[2])

    def _number(self, code: str) -> Any:
        return self._block(code, 1)[0]

    def _block(self, code: str, count: int) -> Any:
        size = struct.calcsize(code)
        self._at += -self._at % size
        at, self._at = self._at, self._at + count * size
        if self._at > len(self._body):
            raise ValueError("a field beyond the end")
        if size == 1 and code == "B" and count > 1:
            return self._body[at : self._at]
        return struct.unpack_from(f"<{count}{code}", self._body, at)
