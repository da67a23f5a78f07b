"""Which files below a folder hold some bytes, also where they are packed."""

from __future__ import annotations

import zipfile
from pathlib import Path

from mcap.reader import NonSeekingReader


def holders(tree: Path, needles: list[bytes]) -> set[Path]:
    """Return the files in which one of these bytes stands."""
    return {
        path
        for path in tree.rglob("*")
        if path.is_file() and any(needle in _bytes_of(path) for needle in needles)
    }


def _bytes_of(path: Path) -> bytes:
    """Return a file's bytes, and what is packed in them."""
    data = path.read_bytes()
    if path.suffix == ".parquet":
        import pyarrow.parquet

        return data + str(pyarrow.parquet.read_table(path).to_pylist()).encode()
    if path.suffix == ".mcap":
        return data + _messages(path)
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as packed:
            return data + b"".join(map(packed.read, packed.namelist()))
    return data


def _messages(path: Path) -> bytes:
    with path.open("rb") as file:
        messages = NonSeekingReader(file).iter_messages(log_time_order=False)
        return b"".join(message.data for _, _, message in messages)
