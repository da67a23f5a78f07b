"""Where a file of kept scans can be torn."""

from __future__ import annotations

from pathlib import Path

from semmap_log.interop.formats.bags.bag_protocol import MAGIC
from semmap_log.interop.formats.bags.unpacking import records


def chunks_at(path: Path) -> list[int]:
    """Where the chunks of a file begin, each a visit."""
    from mcap.opcode import Opcode

    with path.open("rb") as file:
        end = file.seek(0, 2) - len(MAGIC)
        found = records(file, len(MAGIC), end, ())
        return [record.at for record in found if record.opcode == Opcode.CHUNK]
