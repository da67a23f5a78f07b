"""Where each field of a fixed-size message lies in its CDR bytes, read off the `.msg` text.

CDR (XCDR1, little endian, as ROS 2 writes it): four bytes of encapsulation, then the fields in
order, each aligned to its own size, counted from behind those four bytes. A message without
strings and unbounded arrays therefore has one size for ever, and n of them are one numpy array.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

import numpy as np

from semmap_log.domain.meaning import REGISTERS

CDR_HEADER = b"\x00\x01\x00\x00"
"""Representation identifier CDR_LE and no options."""

PACKAGE = "semmap_msgs"

_FIELD = re.compile(r"^(?P<type>\w+)(\[(?P<count>\d+)\])? (?P<name>\w+)\s*(#.*)?$")
_COMMENTED = re.compile(r"^[\w/\[\]]+ +(\w+) *(?:# *(.*))?$")
_CONSTANT = re.compile(r"^\w+ \w+=\S+\s*(#.*)?$")

CODES = {
    "bool": ("?", 1), "uint8": ("B", 1), "int8": ("b", 1), "uint16": ("H", 2), "int16": ("h", 2),
    "uint32": ("I", 4), "int32": ("i", 4), "uint64": ("Q", 8), "int64": ("q", 8),
    "float32": ("f", 4), "float64": ("d", 8),
}  # fmt: skip
"""ROS primitive -> struct code, which is also numpy's, and size in bytes."""


@cache
def message_text(name: str) -> str:
    """Return the `.msg` text of one of our messages, as shipped and as written into each log."""
    text = (files(__package__) / "msg" / f"{name}.msg").read_text(encoding="ascii")
    return text.replace("@REGISTERS@\n", "".join(_register_lines())) if "@" in text else text


def _register_lines() -> Iterator[str]:
    """Yield the lines of Keyframe that hold what is known of doors: values, and their stamps."""
    for register, fields in REGISTERS.items():
        for name, dtype in fields.items():
            yield f"{ROS_NAMES[dtype]}[] {name}\n"
        yield f"int64[] {register}_happened_ns\n"
        yield f"int64[] {register}_event\n"


ROS_NAMES = {"u1": "uint8", "u2": "uint16", "u4": "uint32", "f8": "float64"}
"""Numpy type of a door's field -> ROS's name for it."""


@cache
def comments_of(name: str) -> Mapping[str, str]:
    """Return what the `.msg` text of one of our messages says of each field; "": nothing."""
    found = (_COMMENTED.match(line) for line in message_text(name).splitlines())
    return MappingProxyType({match[1]: match[2] or "" for match in found if match})


@dataclass(frozen=True)
class Layout:
    """The bytes of a fixed-size message, encapsulation included."""

    name: str
    fields: tuple[str, ...]
    dtype: np.dtype[np.void]
    """`itemsize` is the size of the CDR bytes; padding belongs to no field."""
    packer: struct.Struct
    """Packs the field values in order; byte arrays as `bytes`."""

    def pack(self, *values: Any) -> bytes:
        """Return the CDR bytes of these field values, in the order of `fields`."""
        return self.packer.pack(CDR_HEADER, *values)

    def packer_behind(self, prefix: struct.Struct) -> struct.Struct:
        """Return what packs such a message together with fixed fields before it, in one call.

        Args:
            prefix: What comes first, little endian, such as a record's head.
        """
        return struct.Struct(prefix.format + self.packer.format.removeprefix("<"))

    def packer_of(self, count: int) -> struct.Struct:
        """Return what packs so many messages in one call, with zeros as their encapsulation."""
        fields = self.packer.format.removeprefix(f"<{len(CDR_HEADER)}s")
        return struct.Struct("<" + count * f"{len(CDR_HEADER)}x{fields}")

    def unpack(self, data: bytes | memoryview, offset: int = 0) -> dict[str, Any]:
        """Return the field values of the CDR bytes at `offset`."""
        return dict(zip(self.fields, self.packer.unpack_from(data, offset)[1:], strict=True))

    def behind(self, prefix: np.dtype[np.void]) -> np.dtype[np.void]:
        """Return the dtype of such a message that follows other fixed fields, such as a record's.

        Args:
            prefix: What comes first; its fields keep their names and offsets.
        """
        assert prefix.fields is not None
        assert self.dtype.fields is not None
        both = {name: spec[:2] for name, spec in prefix.fields.items()}
        for name, spec in self.dtype.fields.items():
            both[name] = (spec[0], prefix.itemsize + spec[1])
        return np.dtype(
            {
                "names": list(both),
                "formats": [spec[0] for spec in both.values()],
                "offsets": [spec[1] for spec in both.values()],
                "itemsize": prefix.itemsize + self.dtype.itemsize,
            }
        )


@cache
def layout(name: str) -> Layout:
    """Return the layout of one of our messages.

    Raises:
        ValueError: The message has a field without a fixed size.
    """
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    codes = f"<{len(CDR_HEADER)}s"
    end = 0
    for line in message_text(name).splitlines():
        if not line.strip() or line.startswith("#") or _CONSTANT.match(line):
            continue
        match = _FIELD.match(line)
        if match is None or match["type"] not in CODES:
            raise ValueError(f"{name}.msg: no fixed size: {line!r}")
        code, size = CODES[match["type"]]
        padding = -end % size
        count = int(match["count"] or 1)
        names.append(match["name"])
        formats.append((f"<{code}", (count,)) if match["count"] else f"<{code}")
        offsets.append(len(CDR_HEADER) + end + padding)
        codes += "x" * padding + (f"{count}s" if match["count"] else code)
        end += padding + count * size
    dtype = np.dtype(
        {
            "names": names,
            "formats": formats,
            "offsets": offsets,
            "itemsize": len(CDR_HEADER) + end,
        }
    )
    return Layout(name, tuple(names), dtype, struct.Struct(codes))
