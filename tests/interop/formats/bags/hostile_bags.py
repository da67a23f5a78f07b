"""Bags made to do harm: small files that say, or hold, very much."""

from __future__ import annotations

import bz2
import os
import random
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path
from struct import pack

import lz4.frame
import yaml
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, McapRecord, Schema

MIB = 2**20
BOMB_BYTES = 300 * MIB
"""More than any chunk may hold; the child that reads it has not the memory for two of it."""
MAGIC = b"\x89MCAP0\r\n"
TYPE = "std_msgs/msg/Bool"


def zeros_in_zstd(size: int = BOMB_BYTES, *, tells_size: bool = True) -> bytes:
    """Return zeros, packed, without having them all."""
    packer = zstandard.ZstdCompressor(level=3, write_content_size=tells_size)
    stream = packer.compressobj(size=size if tells_size else -1)
    return b"".join([*(stream.compress(part) for part in _zeros(size)), stream.flush()])


def zeros_in_lz4(size: int = BOMB_BYTES) -> bytes:
    """Return zeros, packed, without having them all."""
    with lz4.frame.LZ4FrameCompressor() as packer:
        begun = packer.begin()
        return b"".join([begun, *(packer.compress(part) for part in _zeros(size)), packer.flush()])


def zeros_in_bz2(size: int = BOMB_BYTES) -> bytes:
    """Return zeros, packed, without having them all."""
    packer = bz2.BZ2Compressor()
    return b"".join([*(packer.compress(part) for part in _zeros(size)), packer.flush()])


def _zeros(size: int) -> Iterator[bytes]:
    piece = bytes(MIB)
    for _ in range(size // MIB):
        yield piece


def record(of: McapRecord) -> bytes:
    """Return a record's bytes."""
    builder = RecordBuilder()
    of.write(builder)
    return bytes(builder.end())


def a_channel(definition: bytes = b"bool data") -> list[McapRecord]:
    """Return a schema and its channel, on /door."""
    return [
        Schema(id=1, name=TYPE, encoding="ros2msg", data=definition),
        Channel(id=1, topic="/door", message_encoding="cdr", metadata={}, schema_id=1),
    ]


def mcap_of(*chunks: Chunk, is_indexed: bool = True, records: bytes = b"") -> bytes:
    """Return a closed file of these chunks; with an index that fits them, or without any."""
    data = MAGIC + record(Header(profile="ros2", library="hostile"))
    data += b"".join(record(each) for each in a_channel()) + records
    indexes = []
    for chunk in chunks:
        packed = record(chunk)
        indexes.append(ChunkIndex(
            chunk_length=len(packed), chunk_start_offset=len(data), compression=chunk.compression,
            compressed_size=len(chunk.data), message_end_time=chunk.message_end_time,
            message_index_length=0, message_index_offsets={},
            message_start_time=chunk.message_start_time, uncompressed_size=chunk.uncompressed_size,
        ))  # fmt: skip
        data += packed
    data += record(DataEnd(data_section_crc=0))
    start = len(data) if is_indexed else 0
    if is_indexed:
        data += b"".join(record(each) for each in [*a_channel(), *indexes])
    return data + record(Footer(summary_start=start, summary_offset_start=0, summary_crc=0)) + MAGIC


def chunk_of(data: bytes, compression: str, says: int, *, at: int = 0) -> Chunk:
    """Return a chunk that says that it holds so many bytes."""
    return Chunk(compression=compression, data=data, message_start_time=at, message_end_time=at + 1,
                 uncompressed_crc=0, uncompressed_size=says)  # fmt: skip


def message(at_ns: int, size: int = 1) -> bytes:
    """Return a Message record of /door."""
    body = pack("<HIQQ", 1, 0, at_ns, at_ns) + b"\0\1\0\0" + bytes(size)
    return pack("<BQ", Opcode.MESSAGE, len(body)) + body


def header(**fields: bytes) -> bytes:
    """Return the header of a record of ROS 1's bags."""
    parts = [name.encode() + b"=" + value for name, value in fields.items()]
    text = b"".join(pack("<I", len(part)) + part for part in parts)
    return pack("<I", len(text)) + text


def ros1_bag_of(
    compression: str, data: bytes, *, datasize: int | None = None, entries: int = 1
) -> bytes:
    """Return a `.bag` with one chunk of those bytes, whose index names its one message so often."""
    magic = b"#ROSBAG V2.0\n"
    chunk = header(op=b"\5", compression=compression.encode(), size=pack("<I", 100))
    chunk += pack("<I", len(data) if datasize is None else datasize) + data
    index = header(op=b"\4", ver=pack("<I", 1), conn=pack("<I", 0), count=pack("<I", entries))
    index += pack("<I", 12 * entries) + pack("<III", 1, 0, 0) * entries
    bag = header(op=b"\3", index_pos=bytes(8), conn_count=pack("<I", 1),
                 chunk_count=pack("<I", 1))  # fmt: skip
    head = len(magic) + len(bag) + 4
    bag = header(op=b"\3", index_pos=pack("<Q", head + len(chunk) + len(index)),
                 conn_count=pack("<I", 1), chunk_count=pack("<I", 1)) + pack("<I", 0)  # fmt: skip
    said = header(topic=b"/door", type=b"std_msgs/Bool", md5sum=b"8b94c1b53db61fb6aed406028ad6332a",
                  message_definition=b"bool data")  # fmt: skip
    connection = header(op=b"\7", conn=pack("<I", 0), topic=b"/door")
    connection += said
    info = header(op=b"\6", ver=pack("<I", 1), chunk_pos=pack("<Q", head), count=pack("<I", 1),
                  start_time=pack("<II", 1, 0), end_time=pack("<II", 1, 0))  # fmt: skip
    info += pack("<I", 8) + pack("<II", 0, entries)
    return magic + bag + chunk + index + connection + info


def _folder(path: Path, name: str, mode: str) -> Path:
    path.mkdir()
    told = {"compression_format": "zstd", "compression_mode": mode, "relative_file_paths": [name]}
    (path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": told}))
    return path / name


def packed_file(path: Path) -> None:
    """Write a folder whose one file holds more than a GiB."""
    stream = zstandard.ZstdCompressor(level=3).compressobj()
    parts = [stream.compress(part) for part in (MAGIC, *_zeros(1100 * MIB))]
    _folder(path, "x.mcap.zstd", "FILE").write_bytes(b"".join([*parts, stream.flush()]))


def packed_nothing(path: Path) -> None:
    """Write a folder whose one file holds a GiB of zeros."""
    _folder(path, "x.mcap.zstd", "FILE").write_bytes(zeros_in_zstd(1000 * MIB))


def named_twice(path: Path) -> None:
    """Write a folder that names its one file many times over."""
    file = _folder(path, "x.mcap", "NONE")
    file.write_bytes(mcap_of())
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("- x.mcap", "- x.mcap\n  - x.mcap"))


def packed_message(path: Path) -> None:
    """Write a folder with a message of more than 256 MiB."""
    database = _folder(path, "x.db3", "MESSAGE")
    write_database(database, f"INSERT INTO messages VALUES (1, 1, 5, x'{zeros_in_zstd().hex()}')")


def write_database(path: Path, *statements: str, messages: str = "") -> None:
    """Write a `.db3` of one topic."""
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
                         "serialization_format TEXT, offered_qos_profiles TEXT)")  # fmt: skip
        database.execute(messages or "CREATE TABLE messages(id INTEGER PRIMARY KEY, "
                         "topic_id INTEGER, timestamp INTEGER, data BLOB)")  # fmt: skip
        database.execute(f"INSERT INTO topics VALUES (1, '/door', '{TYPE}', 'cdr', '')")
        for statement in statements:
            database.execute(statement)


def endless_view(path: Path) -> None:
    """Write a `.db3` whose messages SQLite would compute for ever."""
    numbers = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
    row = "i AS id, 1 AS topic_id, i AS timestamp, x'00010000' AS data"
    write_database(path, messages=f"CREATE VIEW messages AS {numbers} SELECT {row} FROM n")


def computed_column(path: Path) -> None:
    """Write a `.db3` whose every message SQLite would make of nothing."""
    write_database(
        path, "INSERT INTO messages(topic_id, timestamp) VALUES (1, 1)",
        messages="CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, "
        "timestamp INTEGER, data BLOB AS (zeroblob(900000000)))",
    )  # fmt: skip


def _file(make: Callable[[], bytes]) -> Callable[[Path], None]:
    return lambda path: (path.write_bytes(make()), None)[1]


END_BYTES = 13 + 29 + 8
"""DataEnd, Footer, magic."""


def _sparse(path: Path) -> None:
    """Write a message of three GiB of holes."""
    body = 3 * 2**30
    path.write_bytes(mcap_of(is_indexed=False)[:-END_BYTES] + pack("<BQ", Opcode.MESSAGE, body))
    end = path.stat().st_size + body
    os.truncate(path, end)
    with path.open("ab") as file:
        file.write(record(DataEnd(data_section_crc=0)))
        file.write(record(Footer(summary_start=0, summary_offset_start=0, summary_crc=0)) + MAGIC)


def _overlapping() -> bytes:
    """Return chunks that all hold the same hour; each is good by itself."""
    inside = message(0, 40 * MIB) + message(10**9, 40 * MIB)
    packed = zstandard.compress(inside)
    return mcap_of(*(chunk_of(packed, "zstd", len(inside)) for _ in range(40)))


def _chunk_of_zeros(size: int) -> bytes:
    return mcap_of(chunk_of(zeros_in_zstd(size), "zstd", size))


def _tiny(*, is_indexed: bool) -> bytes:
    """Return very many messages that are all alike, in few bytes."""
    inside = message(5) * 2_000_000
    return mcap_of(chunk_of(zstandard.compress(inside), "zstd", len(inside)), is_indexed=is_indexed)


def _large(*, is_indexed: bool) -> bytes:
    """Return chunks with a large message each: one by one they are allowed."""
    chunks = []
    for i in range(10):
        inside = message(10 * i, 120 * MIB)
        chunks.append(chunk_of(zstandard.compress(inside), "zstd", len(inside), at=10 * i))
    return mcap_of(*chunks, is_indexed=is_indexed)


def _one_again_and_again() -> bytes:
    """Return a `.bag` whose index names one large message a thousand times."""
    inside = header(op=b"\2", conn=pack("<I", 0), time=pack("<II", 1, 0))
    inside += pack("<I", 90 * MIB) + bytes(90 * MIB)
    return ros1_bag_of("bz2", bz2.compress(inside), entries=1000)


TOO_MUCH = "expected at most 128 MiB, or 1,000 times its packed bytes, and never more than 256 MiB"
MORE = "unpacked bytes, got more"
IN_ALL = "expected at most 1 GiB, or 4,000 times the file's bytes, of chunks and messages"
SAYS = BOMB_BYTES
HOSTILE: dict[str, tuple[Callable[[Path], None], str]] = {
    "says.mcap": (_file(lambda: mcap_of(chunk_of(zeros_in_zstd(), "zstd", SAYS))), TOO_MUCH),
    "two-gib.mcap": (
        _file(lambda: mcap_of(chunk_of(zeros_in_zstd(2**31), "zstd", 2**31))), TOO_MUCH
    ),
    "hides.mcap": (_file(lambda: mcap_of(chunk_of(zeros_in_zstd(), "zstd", 100))), MORE),
    "streams.mcap": (
        _file(lambda: mcap_of(chunk_of(zeros_in_zstd(tells_size=False), "zstd", 100))), MORE
    ),
    "lz4.mcap": (_file(lambda: mcap_of(chunk_of(zeros_in_lz4(), "lz4", SAYS))), TOO_MUCH),
    "hides-lz4.mcap": (_file(lambda: mcap_of(chunk_of(zeros_in_lz4(), "lz4", 100))), MORE),
    "not-indexed.mcap": (
        _file(lambda: mcap_of(chunk_of(zeros_in_zstd(), "zstd", SAYS), is_indexed=False)), TOO_MUCH
    ),
    "not-indexed-lz4.mcap": (
        _file(lambda: mcap_of(chunk_of(zeros_in_lz4(), "lz4", 9), is_indexed=False)), MORE
    ),
    "allowed-zeros.mcap": (_file(lambda: _chunk_of_zeros(100 * MIB)), "got one of no kind"),
    "overlapping.mcap": (_file(_overlapping), "the times of its chunks overlap too far"),
    "sparse.mcap": (_sparse, "expected at most 256 MiB, got 3,221,225,472 bytes"),
    "summary.mcap": (
        _file(lambda: mcap_of(is_indexed=False)[:-28] + pack("<QQI", 2**63, 0, 0) + MAGIC),
        "expected its summary before byte",
    ),
    "bz2.bag": (_file(lambda: ros1_bag_of("bz2", zeros_in_bz2())), TOO_MUCH),
    "lz4.bag": (_file(lambda: ros1_bag_of("lz4", zeros_in_lz4())), TOO_MUCH),
    "no-lz4.bag": (_file(lambda: ros1_bag_of("lz4", b"nonsense")), "it is no lz4"),
    "tiny.mcap": (_file(lambda: _tiny(is_indexed=True)), "records in what it is packed in"),
    "tiny-not-indexed.mcap": (
        _file(lambda: _tiny(is_indexed=False)), "records in what it is packed in"
    ),
    "large.mcap": (_file(lambda: _large(is_indexed=True)), IN_ALL),
    "large-not-indexed.mcap": (_file(lambda: _large(is_indexed=False)), IN_ALL),
    "again.bag": (_file(_one_again_and_again), IN_ALL),
    "nothing": (packed_nothing, "expected a packed .mcap or .db3, got something else"),
    "twice": (named_twice, "expected each file once, got one twice"),
    "file": (packed_file, "expected at most 1 GiB, or 1,000 times its own bytes"),
    "message": (packed_message, TOO_MUCH),
    "view.db3": (endless_view, "expected messages to be a table of rosbag2, got a view"),
    "computed.db3": (computed_column, "expected messages to be a table of rosbag2"),
}  # fmt: skip
"""Name -> what writes it, and what has to be said of it."""


def mutated(data: bytes, dice: random.Random) -> bytes:
    """Return bytes that were flipped, overwritten, cut out, doubled or cut off, in a few places."""
    hurt = bytearray(data)
    for _ in range(dice.choice((1, 1, 1, 2, 4, 8))):
        at = dice.randrange(len(hurt))
        match dice.randrange(6):
            case 0:
                hurt[at] ^= 1 << dice.randrange(8)
            case 1:
                hurt[at : at + 4] = dice.choice((b"\xff" * 4, bytes(4), dice.randbytes(4)))
            case 2:
                hurt[at : at + 8] = dice.choice((b"\xff" * 8, bytes(8), pack("<Q", 2**32)))
            case 3:
                del hurt[at : at + dice.choice((1, 2, 8, 100))]
            case 4:
                begin = dice.randrange(len(hurt))
                hurt[at:at] = hurt[begin : begin + dice.choice((1, 8, 100))]
            case _:
                del hurt[at:]
        hurt = hurt or bytearray(b"x")
    return bytes(hurt)
