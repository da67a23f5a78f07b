"""Verification, recovery, compaction and writers, with logs of a later version."""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import NewerLogError
from semmap_log.log.replay.maintenance import plan_recovery, recover, verify
from semmap_log.store.byte_layout import FORMAT_MINOR
from semmap_log.store.compaction import compact
from semmap_log.store.newer import NOTHING_NEWER
from semmap_log.store.reading.segment_reading import statistics_of
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.records import MESSAGE
from tests.log.signing.signed_logs import a_key, is_good, sign
from tests.newer.logs import UNKNOWN, NewerLogs
from tests.store.logs import digest_of_records, segment_files

STRENGTH = b"\0\0\0\0\0\0\x08@"
"""3.0, as it stands in the event of the unknown kind, and nowhere else."""


def test_verify_names_what_it_could_not_look_into(newer: NewerLogs, tmp_path: Path) -> None:
    """It is good, and the later version thinks so, too."""
    log = newer.log("locked", tmp_path)

    found = verify(log)

    assert (found.exit_code, found.events) == (0, 5)
    assert [f.kind for f in found.findings] == ["newer"]
    assert "1 DoorLocked" in found.findings[0].text
    assert newer.ask("locked", log)["head"] == found.head.hex()


@pytest.mark.parametrize("name", ["locked", "weighed", "unsaid"])
def test_events_of_a_later_version_are_signed(newer: NewerLogs, tmp_path: Path, name: str) -> None:
    """Their bytes and their place are in the hash chain, as all others are."""
    log, key = newer.log(name, tmp_path), a_key(tmp_path)

    assert 1 == len(sign(log, key).made)
    assert is_good(log, key)


def test_the_hash_chain_goes_over_unknown_events(newer: NewerLogs, tmp_path: Path) -> None:
    """Somebody changed one, and made its chunk's CRC fit: its commit's hash does not."""
    log = newer.log("locked", tmp_path, how="live")
    (path,) = segment_files(log)
    _change_event(path, STRENGTH, b"\0\0\0\0\0\0\x18@")

    found = verify(log)

    assert found.exit_code == 4
    assert any("its hash is not that of its records" in f.text for f in found.findings)


def test_a_head_that_lacks_what_its_version_has_is_damage(newer: NewerLogs, tmp_path: Path) -> None:
    """A Schema that became another's is not taken for that of a later kind."""
    log = newer.log("locked", tmp_path, how="live")
    (path,) = segment_files(log)
    data = bytearray(path.read_bytes())
    at = data.index(b"semmap_msgs/msg/DoorPassed")
    data[at - 6] ^= 0x10  # the Schema's id: of kind 6 it becomes 22
    path.write_bytes(data)

    found = verify(log)

    assert any(
        "the Schema semmap_msgs/msg/DoorPassed is not ours" in f.text for f in found.findings
    )


@pytest.mark.parametrize("name", ["locked", "weighed", "entry", "minor"])
def test_compaction_keeps_all_of_it(newer: NewerLogs, tmp_path: Path, name: str) -> None:
    """Records, their channels, and what is said in the head: the later version finds the same."""
    log = newer.log(name, tmp_path)
    before, records = newer.ask(name, log), digest_of_records(log)

    done = compact(log)

    assert done.steps
    assert digest_of_records(log) == records
    assert newer.ask(name, log) == before
    assert verify(log).exit_code == 0


def test_a_merged_segment_has_what_any_of_them_had(newer: NewerLogs, tmp_path: Path) -> None:
    """The first was written before the later version came to the log."""
    log = tmp_path / "office"
    with sl.create(log, tz="Europe/Vienna") as made:
        door = made.add_door(x=2.0, y=1.5, theta=0.0, width=0.9, state="closed", name="front")
        made.observe(door, "open")
    newer.run("weighed", _GO_ON, log)
    assert len(segment_files(log)) == 1
    before = newer.ask("weighed", log)
    assert before["minor"] == [FORMAT_MINOR + 1]

    compact(log)

    assert newer.ask("weighed", log) == before
    assert "DoorWeighed" in before["kinds"]


def test_an_older_writer_goes_on_where_nothing_is_changed(newer: NewerLogs, tmp_path: Path) -> None:
    """What it does not know stays in the log, in the heads of its segments, too."""
    log = newer.log("weighed", tmp_path)
    before = newer.ask("weighed", log)

    with pytest.warns(sl.errors.NewerLogWarning), sl.append(log) as writer:
        writer.observe(sl.DoorId(1), "open")

    after = newer.ask("weighed", log)
    assert after["kinds"] == [*before["kinds"], "DoorObserved"]
    assert after["fields"] == before["fields"]
    assert (after["state"], after["exit"], after["findings"]) == ("OPEN", 0, [])
    assert after["minor"] == [FORMAT_MINOR + 1]


def test_the_next_segment_has_what_the_last_one_had(newer: NewerLogs, tmp_path: Path) -> None:
    """The Metadata's entry, the later kind's Schema and Channel, and the version."""
    log = newer.log("weighed", tmp_path)
    path, head = segment_files(log)[0], b"semmap_msgs/msg/DoorWeighed"
    newer.run("weighed", _FILL, log)

    with pytest.warns(sl.errors.NewerLogWarning), sl.append(log) as writer:
        writer.observe(sl.DoorId(1), "open")

    first, *others = segment_files(log)
    assert first == path
    assert others
    assert all(head in one.read_bytes() for one in others)
    assert statistics_of(open_segment(first)).newer != NOTHING_NEWER
    assert newer.ask("weighed", log)["findings"] == []


def test_an_entry_of_a_later_version_stays(newer: NewerLogs, tmp_path: Path) -> None:
    """Whatever is written anew: the segment that is continued, its compacted copy."""
    log = newer.log("entry", tmp_path)

    with sl.append(log) as writer:
        writer.observe(sl.DoorId(1), "open")
    compact(log)

    assert b"west" in segment_files(log)[0].read_bytes()
    assert newer.ask("entry", log)["findings"] == []


def test_a_writer_that_cannot_know_the_doors_is_refused(newer: NewerLogs, tmp_path: Path) -> None:
    """It would check commands against doors that may be others."""
    log = newer.log("locked", tmp_path, how="live")
    before = segment_files(log)[0].read_bytes()

    with pytest.raises(NewerLogError, match="event 3 is of kind DoorLocked"):
        sl.append(log)

    assert segment_files(log)[0].read_bytes() == before


def test_there_is_nothing_to_recover_of_a_whole_log(newer: NewerLogs, tmp_path: Path) -> None:
    """Unknown events are no damage: nothing of them is dropped."""
    log = newer.log("locked", tmp_path)
    before = segment_files(log)[0].read_bytes()

    assert not plan_recovery(log).has_to_do
    assert recover(log).log is None
    assert segment_files(log)[0].read_bytes() == before


@pytest.mark.parametrize("name", ["locked", "weighed"])
def test_recovery_never_drops_what_it_does_not_know(
    newer: NewerLogs, tmp_path: Path, name: str
) -> None:
    """Where it would have to give it another number, or a keyframe, it leaves the log as it is."""
    log = newer.log(name, tmp_path)
    (path,) = segment_files(log)
    data = bytearray(path.read_bytes())
    data[data.index(b"front")] ^= 1  # in the first commit: all others get new numbers
    path.write_bytes(data)

    with pytest.raises(NewerLogError, match="not to be recovered here"):
        recover(log)

    assert path.read_bytes() == data
    assert [one.name for one in log.iterdir() if one.name.startswith("damaged")] == []


def test_recovery_keeps_marked_events_that_keep_their_numbers(
    newer: NewerLogs, tmp_path: Path
) -> None:
    """Byte for byte, with their channel: the later version reads them in the log that is made."""
    log = newer.log("weighed", tmp_path)
    (path,) = segment_files(log)
    fields = newer.ask("weighed", log)["fields"]
    data = bytearray(path.read_bytes())
    data[data.index(b"\5\0\0\0late\0") + 4] ^= 1  # in the last commit
    path.write_bytes(data)

    recover(log)

    after = newer.ask("weighed", log)
    assert after["fields"] == fields
    assert after["kinds"][UNKNOWN] == "DoorWeighed"
    assert (after["exit"], after["findings"]) == (0, [])


_GO_ON = """
import sys, semmap_log as sl
from semmap_log.core.model.events import DoorWeighed
with sl.append(sys.argv[1]) as log:
    log.append([DoorWeighed(door_id=1, strength=3.0)])
"""
_FILL = """
import sys, semmap_log as sl
with sl.append(sys.argv[1], compact=False) as log:
    for i in range(40):
        log.annotate(1, f"key{i}", "\\u00e4" * 30_000)
"""


def _change_event(path: Path, old: bytes, new: bytes) -> None:
    """Change an event, and the CRC of the uncompressed chunk that it lies in."""
    data = path.read_bytes()
    at = data.index(old)
    start = data.rindex(b"\x06", 0, at - MESSAGE.size)
    while True:  # the chunk's head: its records follow 40 bytes behind the frame
        records = start + 9 + 40
        size = int.from_bytes(data[start + 25 : start + 33], "little")
        crc = int.from_bytes(data[start + 33 : start + 37], "little")
        if records <= at < records + size <= len(data) and (
            zlib.crc32(data[records : records + size]) == crc
        ):
            break
        start = data.rindex(b"\x06", 0, start)
    changed = data[:at] + new + data[at + len(new) :]
    fits = zlib.crc32(changed[records : records + size]).to_bytes(4, "little")
    path.write_bytes(changed[: start + 33] + fits + changed[start + 37 :])
