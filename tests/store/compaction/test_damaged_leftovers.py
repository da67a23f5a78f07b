"""Files that the log does not need, since they were merged into another, or are not yet: damaged.

They cost nothing: every question is answered, `verify` names them, a compaction removes them.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.maintenance import recover, verify
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.verification import Severity
from semmap_log.store.writing import segment_chain
from tests.store.logs import digest_of_records, write_log

DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "magic": lambda data: flipped(data, 1),
    "record behind it": lambda data: flipped(data, 9),
    "head": lambda data: flipped(data, 150),
    "first chunk": lambda data: flipped(data, len(data) // 3),
    "summary": lambda data: flipped(data, -60),
    "empty": lambda _data: b"",
    "cut in the head": lambda data: data[:100],
    "cut": lambda data: data[: len(data) // 2],
    "zeros": lambda data: bytes(len(data)),
}


def flipped(data: bytes, at: int) -> bytes:
    changed = bytearray(data)
    changed[at] ^= 1
    return bytes(changed)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A log of three closed segments, and a live one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 20)
        yield write_log(tmp_path_factory.mktemp("leftovers") / "log", 70)


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_leftover_costs_nothing(original: Path, tmp_path: Path, damage: str) -> None:
    """One of two files that lie in the merged one."""
    log = Path(shutil.copytree(original, tmp_path / "log"))
    compact(log)
    path = Path(LogReader(log).leftovers[0])
    path.write_bytes(DAMAGES[damage](path.read_bytes()))

    named = [f.path for f in verify(log).findings if f.severity is Severity.WARNING]

    assert named == [path]
    check_costs_nothing(log, original)
    assert not path.exists()


def check_costs_nothing(log: Path, original: Path) -> None:
    """Check each kind of question; then compact, which removes what is not needed."""
    assert digest_of_records(log) == digest_of_records(original)
    assert repr(sl.read(log).replay().doors) == repr(sl.read(original).replay().doors)
    found = verify(log)
    assert (found.exit_code, found.head) == (0, verify(original).head)
    assert not recover(log).plan.has_to_do
    last = sl.read(log).last_event()
    with sl.append(log, compact=False) as opened:
        opened.observe(DoorId(1), "open")
    assert sl.read(log).last_event() == last + 1

    compact(log, keep_s=0)

    assert not LogReader(log).leftovers
    assert not [f for f in verify(log).findings if f.severity]


def test_a_damaged_file_that_no_other_holds_is_needed(original: Path, tmp_path: Path) -> None:
    """Nor does a name of another log make it a leftover."""
    log = Path(shutil.copytree(original, tmp_path / "log"))
    compact(log)
    left = Path(LogReader(log).leftovers[0])
    left.write_bytes(flipped(left.read_bytes(), 150))
    left.rename(log / "other_000001.mcap")

    with pytest.raises(CorruptLogError, match="other_000001"):
        sl.read(log)
    assert verify(log).exit_code == 4
