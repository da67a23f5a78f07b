"""Where each field of a fixed-size message lies in its CDR bytes, read off the `.msg` text.

CDR (XCDR1, little endian, as ROS 2 writes it): four bytes of encapsulation, then the fields in
order, each aligned to its own size, counted from behind those four bytes. A message without
strings and unbounded arrays therefore has one size for ever, and n of them are one numpy array.
"""

from __future__ import annotations

import struct
from functools import cache
from typing import Any

import numpy as np

from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.messages.cdr import CDR_HEADER
from semmap_log.core.messages.definitions import CODES, flat_fields, type_name


@dataclass(frozen=True, slots=True)
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

    def packer_behind(self, prefix: struct.Struct, count: int = 1) -> struct.Struct:
        """Return what packs such a message together with fixed fields before it, in one call.

        Args:
            prefix: What comes first, little endian, such as a record's head.
            count: How many such pairs it packs, one behind the other.
        """
        one = prefix.format.removeprefix("<") + self.packer.format.removeprefix("<")
        return struct.Struct("<" + count * one)

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
    for field in flat_fields(type_name(name)):
        if field.type not in CODES or field.count == 0:
            raise ValueError(f"{name}.msg: no fixed size: {field.name}")
        code, size = CODES[field.type]
        padding = -end % size
        count = field.count or 1
        names.append(field.name)
        formats.append((f"<{code}", (count,)) if field.count else f"<{code}")
        offsets.append(len(CDR_HEADER) + end + padding)
        codes += "x" * padding + (f"{count}s" if field.count else code)
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
