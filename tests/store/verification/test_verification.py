"""Verification: a whole log is good, and nothing that was changed goes unnoticed."""

from __future__ import annotations

import os
import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode

import semmap_log as sl
from semmap_log.errors import NewerLogError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import COMMIT_CHANNEL, KEYFRAME_CHANNEL, NOTE_CHANNEL
from semmap_log.store.chunks import build_chunk
from semmap_log.store.compaction import compact
from semmap_log.store.folder import LogFolder
from semmap_log.store.pages import KEYFRAME_BIT
from semmap_log.store.reading.segment_reading import read_chunk
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.record_scan import frames
from semmap_log.store.verification import Finding, Severity, Verification
from tests.marks import remove_marks
from tests.store.eventful import contents, eventful_log, flip

RECORDINGS = Path(__file__).parents[3] / "recordings"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A closed log of three segments; not to be changed."""
    return eventful_log(tmp_path_factory.mktemp("original") / "log")


@pytest.fixture(scope="module")
def original_live(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with its last segment still live."""
    folder = tmp_path_factory.mktemp("live")
    eventful_log(folder / "log", copy=folder / "copy")
    return folder / "copy"


@pytest.fixture
def log(original: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(shutil.copytree(original, tmp_path / "log"))


@pytest.fixture
def live(original_live: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original_live, tmp_path / "live"))


def segment(log: Path, number: int) -> Path:
    return sorted(log.glob("*.mcap"))[number]


def worst(found: Verification) -> Finding:
    return found.findings[0]


@pytest.mark.parametrize("name", ["office", "clinic_week"])
def test_the_recordings_are_good(name: str) -> None:
    """Every event is read, every keyframe compared, and nothing at all is found."""
    found = verify(RECORDINGS / name)
    reader = sl.read(RECORDINGS / name)._reader

    assert () == found.findings
    assert 0 == found.exit_code
    assert sum(len(batch) for batch in reader.batches()) == found.events
    assert len(list(reader.commits())) == found.commits
    assert len(reader.segments) == found.segments
    assert sum(len(s.chunks.having(KEYFRAME_BIT)) for s in reader.segments) == found.keyframes
    assert reader.last_commit().hash == found.head  # type: ignore[union-attr]


def test_a_log_with_everything_is_good_whatever_is_done_to_it(log: Path, live: Path) -> None:
    """Closed, live, compacted, continued; and verifying changes no byte."""
    before = contents(log), contents(live)

    assert (0, 0) == (verify(log).exit_code, verify(live).exit_code)
    assert before == (contents(log), contents(live))
    compact(log, keep_s=0)
    assert () == verify(log).findings
    with sl.append(log) as opened:
        opened.observe("front", "closed")
    assert (0, 14) == (verify(log).exit_code, verify(log).events)


def test_one_file_of_the_middle_is_good_by_itself(original: Path) -> None:
    """It begins where its header says, and its own keyframe is the state to begin with."""
    found = verify(segment(original, 1))

    assert () == found.findings
    assert (1, 4) == (found.segments, found.commits)


def outside_the_texts(file: Path) -> list[int]:
    """Return where the bytes of a segment lie that are no Schema or Channel."""
    data = memoryview(file.read_bytes())
    places = list(range(len(mcap.MAGIC)))
    for opcode, offset, length in frames(data, len(mcap.MAGIC), len(data)):
        is_text = opcode in (Opcode.SCHEMA, Opcode.CHANNEL)
        places += range(offset, offset + length) if not is_text else ()
    return [*places, *range(len(data) - len(mcap.MAGIC), len(data))]


@pytest.mark.slow
def test_every_flipped_bit_is_found(log: Path) -> None:
    """In a closed segment: damage, always, and named in that file."""
    file = segment(log, 1)
    whole = file.read_bytes()
    places = [8 * at + at % 8 for at in {*outside_the_texts(file)[::3], *range(0, len(whole), 97)}]
    if os.environ.get("SEMMAP_EVERY_BIT"):
        places = list(range(8 * len(whole)))
    missed = []
    for place in places:
        flip(file, place // 8, place % 8)
        found = verify(file)
        if found.exit_code != 4 or worst(found).path != file:
            missed.append((place, found.exit_code))
        file.write_bytes(whole)

    assert [] == missed
    assert len(places) > 1000


@pytest.mark.slow
def test_a_closing_that_was_not_finished_is_a_torn_tail(log: Path) -> None:
    """Of a single file cut in its summary, or with lost sectors there."""
    file = segment(log, 2)
    whole = file.read_bytes()
    end = open_segment(file).valid_end
    for size in range(end + 1, len(whole) - 1, 97):
        file.write_bytes(whole[:size])
        assert (3, "torn") == (verify(file).exit_code, worst(verify(file)).kind), size
    file.write_bytes(whole[: len(whole) // 512 * 512 - 512].ljust(len(whole), b"\0"))
    assert 3 == verify(file).exit_code

    assert 3 == verify(log).exit_code
    remove_marks(log)
    found = verify(log)

    assert (4, "shortened", file) == (found.exit_code, worst(found).kind, worst(found).path)


@st.composite
def mutations(draw: st.DrawFn) -> list[tuple[str, float, int, int]]:
    one = st.tuples(
        st.sampled_from(["flip", "cut", "insert", "swap", "double", "zero", "end"]),
        st.floats(0, 1, exclude_max=True),
        st.sampled_from([1, 2, 9, 31, 64, 512, 4096, 30_000]),
        st.integers(0, 2**32 - 1),
    )
    return draw(st.lists(one, min_size=1, max_size=5))


def mutated(data: bytes, changes: list[tuple[str, float, int, int]]) -> bytes:
    """Return the bytes, changed at those places (0..1) and lengths."""
    changed = bytearray(data)
    for what, place, length, number in changes:
        if not changed:
            break
        at = int(place * len(changed))
        end = min(len(changed), at + length)
        other = number % len(changed)
        if what == "flip":
            changed[at] ^= 1 << (number % 8)
        elif what == "cut":
            del changed[at:end]
        elif what == "insert":
            changed[at:at] = number.to_bytes(4, "little") * (length // 4 + 1)
        elif what == "swap":
            one, two = bytes(changed[at:end]), bytes(changed[other : other + end - at])
            changed[other : other + len(two)] = one[: len(two)]
            changed[at : at + len(two)] = two
        elif what == "double":
            changed[other:other] = changed[at:end]
        elif what == "zero":
            changed[at:end] = bytes(end - at)
        else:
            del changed[at:]
    return bytes(changed)


@pytest.mark.slow
@settings(max_examples=60, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture,
                                 HealthCheck.too_slow])  # fmt: skip
@given(number=st.integers(0, 2), changes=mutations())
def test_no_bytes_are_too_wild(
    log: Path, original: Path, number: int, changes: list[tuple[str, float, int, int]]
) -> None:
    """Flipped, cut, inserted, swapped, doubled, zeroed: good only if nothing is different."""
    file = segment(log, number)
    whole = segment(original, number).read_bytes()
    changed = mutated(whole, changes)
    file.write_bytes(changed)

    in_folder, alone = verify(log), verify(file)

    file.write_bytes(whole)
    assert (in_folder.exit_code == 0) == (changed == whole)
    assert (alone.exit_code == 0) == (changed == whole)


def test_all_damage_is_named_not_only_the_first(log: Path) -> None:
    """It goes on at the next chunk and the next segment, and says which events each place cost."""
    places = []
    for number in (0, 1):
        file = segment(log, number)
        chunk = open_segment(file).chunks[2]
        flip(file, chunk.data_offset + 40)
        places.append((file, chunk.offset))
    flip(segment(log, 2), 4000)

    found = verify(log)

    damage = found.of(Severity.DAMAGE)
    assert [*places, segment(log, 2)] == [(f.path, f.offset) for f in damage[:2]] + [damage[2].path]
    assert [(2, 3), (7, 7), None] == [f.events for f in damage]
    assert (9, 10) == (found.commits, found.events)


def test_segments_are_named(log: Path, original: Path, tmp_path: Path) -> None:
    """Missing, there twice, of another log, under the wrong name, no segment at all."""
    middle, last = segment(log, 1), segment(log, 2)
    aside = tmp_path / "aside"

    middle.rename(aside)
    assert [("missing", middle, (6, 9))] == named(log)
    aside.rename(middle)

    shutil.copy(middle, log / "copy.mcap")
    assert [("duplicated", middle, None)] == named(log)
    (log / "copy.mcap").unlink()

    foreign = log / "other_000007.mcap"
    with sl.create(tmp_path / "other", tz="UTC") as opened:
        opened.add_door()
    for data in (segment(tmp_path / "other", 0).read_bytes(), b"\x89MCAP0\r\n", b"text"):
        foreign.write_bytes(data)
        assert foreign in {path for _, path, _ in named(log)}
    foreign.unlink()

    swap(middle, last, aside)
    assert {("name", middle, None), ("name", last, None)} == set(named(log))
    swap(middle, last, aside)
    assert [] == named(log)


def named(log: Path) -> list[tuple[str, Path, object]]:
    return [(f.kind, f.path, f.events) for f in verify(log).of(Severity.DAMAGE)]


def swap(one: Path, other: Path, aside: Path) -> None:
    one.rename(aside)
    other.rename(one)
    aside.rename(other)


def test_a_cut_tail_shows_by_what_was_written_or_by_a_head_kept_elsewhere(log: Path) -> None:
    """A whole segment gone from the end leaves a chain that is whole in itself."""
    old, size = verify(log).head, verify(log).events
    with sl.append(log) as opened:
        opened.observe("front", "open")  # a day later, so in a segment of its own
    grown, head = verify(log, old), verify(log).head
    assert (0, 1) == (grown.exit_code, grown.events_after_head)

    segment(log, -1).unlink()
    by_mark = verify(log)
    remove_marks(log)
    by_metadata = verify(log)
    (log / "metadata.yaml").unlink()
    alone = verify(log)
    by_head = verify(log, head)

    assert ("shortened", 4) == (worst(by_mark).kind, by_mark.exit_code)
    assert (size, size) == worst(by_mark).events
    assert ("missing", 4) == (worst(by_metadata).kind, by_metadata.exit_code)
    assert (0, Severity.WARNING) == (alone.exit_code, worst(alone).severity)
    assert ("head", 4) == (worst(by_head).kind, by_head.exit_code)
    assert alone.head.hex() in worst(by_head).text
    assert alone.events == size


def test_what_is_harmless_is_a_note(log: Path) -> None:
    """A kept tail, a temporary file, a metadata.yaml that says something else: the log is good."""
    (log / "log_000001.mcap.torn-77").write_bytes(b"x")
    (log / ".log_000009.mcap.1.tmp").write_bytes(b"x")
    (log / "metadata.yaml").write_text("something: else\n")

    found = verify(log)

    assert 0 == found.exit_code
    assert ["metadata", "leftover", "leftover"] == [f.kind for f in found.findings]


def test_a_leftover_of_a_merge_is_a_note(log: Path) -> None:
    """A segment that another one stands for is no copy too many; with other commits it is."""
    from semmap_log.store.compaction.merge import rechunked

    second = segment(log, 1).read_bytes()
    with rechunked(LogFolder(log), [open_segment(segment(log, n)) for n in (0, 1)]) as writer:
        writer.install(replacing=identity_of(segment(log, 0)))

    found = verify(log)
    assert (0, 2, {"leftover"}) == (
        found.exit_code,
        found.keyframes,
        {f.kind for f in found.findings if f.severity is Severity.NOTE},
    )
    assert second == segment(log, 1).read_bytes()

    flip(segment(log, 1), open_segment(segment(log, 1)).chunks[1].data_offset)
    assert (0, Severity.WARNING) == (verify(log).exit_code, worst(verify(log)).severity)


def test_a_leftover_with_other_commits_is_one_file_too_many(log: Path, tmp_path: Path) -> None:
    """Its number is that of a merged segment, but its hash comes nowhere in the log."""
    from semmap_log.store.compaction.merge import rechunked

    with rechunked(LogFolder(log), [open_segment(segment(log, n)) for n in (0, 1)]) as writer:
        writer.install(replacing=identity_of(segment(log, 0)))
    other = eventful_log(tmp_path / "other", accuracy=0.8)
    shutil.copy(segment(other, 1), segment(log, 1))

    assert [("duplicated", segment(log, 1), None)] == named(log)


def identity_of(file: Path) -> tuple[int, int]:
    return file.stat().st_dev, file.stat().st_ino


SEQUENCED = {
    "a note that is not of its last event": NOTE_CHANNEL,
    "its Commit record lacks its last event's number": COMMIT_CHANNEL,
    "a keyframe of another event": KEYFRAME_CHANNEL,
}
"""What is found where such a record has the next number."""


def rewritten(file: Path, change: str) -> None:
    """Change a segment as a forger would: every checksum fits again, but not the hashes."""
    from semmap_log.store.pages import Page
    from semmap_log.store.segment import SegmentWriter

    old = open_segment(file)
    writer = SegmentWriter(LogFolder(file.parent), file.name, old.header)
    for number, chunk in enumerate(old.chunks):
        records = bytearray(read_chunk(old, chunk))
        page = Page(bytes(records), old.header.first_event, file)
        if change == "keyframe" and page.heads["channel_id"][0] == KEYFRAME_CHANNEL:
            records[-20] ^= 1
        if change == "event" and number == 2:
            records[mcap.MESSAGE.size + 12] ^= 1
        if change == "order" and number in (2, 3):
            other = old.chunks[5 - number]
            records = bytearray(read_chunk(old, other))
        if change == "left out" and number == 2:
            continue
        for place in np.flatnonzero(page.heads["channel_id"] == SEQUENCED.get(change, -1)):
            at = page.offsets[place] + mcap.FRAME.size + 2
            records[at : at + 4] = int(page.heads["sequence"][place] + 1).to_bytes(4, "little")
        page = Page(bytes(records), old.header.first_event, file)
        writer.add(build_chunk(bytes(records), page.offsets), levels=page.levels)
    writer.close()
    writer.install(replacing=identity_of(file))


@pytest.mark.parametrize(
    ("change", "kinds"),
    [
        ("keyframe", {"keyframe"}),
        ("event", {"commit"}),
        ("order", {"missing", "repeated", "time"}),
        ("left out", {"missing"}),
    ],
)
def test_a_forger_who_mends_the_checksums_is_found(change: str, kinds: set[str], log: Path) -> None:
    """The hash chain and the replay know better than any CRC."""
    rewritten(segment(log, 1), change)

    found = verify(log)

    assert kinds == {f.kind for f in found.of(Severity.DAMAGE)}


@pytest.mark.parametrize("problem", SEQUENCED)
def test_a_record_belongs_to_an_event(problem: str, log: Path) -> None:
    """One with the number of another event is named."""
    rewritten(segment(log, 1), problem)

    assert any(problem in finding.text for finding in verify(log).findings)


@pytest.mark.parametrize("byte", [0, mcap.FRAME.size])
def test_a_bad_place_before_what_was_not_durable_is_a_torn_tail(byte: int, tmp_path: Path) -> None:
    """Of a live segment, its frame or its times: a disk may write the later bytes first."""
    with sl.create(tmp_path / "log", tz="UTC", durability="flush") as log:
        for _ in range(3):
            log.add_door()
        live = Path(shutil.copytree(tmp_path / "log", tmp_path / "live"))
    chunk = open_segment(segment(live, 0)).chunks[-2]
    flip(segment(live, 0), chunk.offset + byte, 7)

    found = verify(live)

    assert (3, "torn", 1) == (found.exit_code, worst(found).kind, found.events)


def test_a_whole_index_that_cannot_be_read_is_damage(live: Path) -> None:
    """A crash during the closing leaves a part of it, never another."""
    file = segment(live, 2)
    end = open_segment(file).valid_end
    file.write_bytes(file.read_bytes()[:end] + mcap.FRAME.pack(Opcode.METADATA, 3) + b"abc")

    found = verify(live)

    assert (4, "index") == (found.exit_code, worst(found).kind)


def test_what_is_no_log(tmp_path: Path) -> None:
    """Nothing there, an empty folder, a text, an empty file, somebody else's MCAP file: 5."""
    from mcap.writer import Writer

    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mcap").write_text("no log")
    (tmp_path / "nothing.mcap").write_bytes(b"")
    with (tmp_path / "bag.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="another")
        writer.finish()

    for name in ("absent", "empty", "text.mcap", "nothing.mcap", "bag.mcap", "."):
        found = verify(tmp_path / name)
        assert (5, 0) == (found.exit_code, found.segments), name


@pytest.mark.parametrize(("version", "is_newer"), [("9", True), ("2", False)])
def test_another_format_is_an_error_not_damage(log: Path, version: str, is_newer: bool) -> None:
    """Its bytes may be all right: this program cannot tell."""
    from dataclasses import replace

    from semmap_log.store import header as header_module
    from semmap_log.store.segment import SegmentWriter

    header = replace(open_segment(segment(log, 2)).header, number=3, last_number=3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(header_module, "FORMAT_VERSION", version)
        writer = SegmentWriter(LogFolder(log), "log_000003.mcap", header)
        writer.close()
        writer.install()

    with pytest.raises(sl.SemmapError, match=f"format version '{version}'") as raised:
        verify(log)
    assert is_newer == isinstance(raised.value, NewerLogError)


def test_progress_reaches_the_end(log: Path) -> None:
    """Bytes done only grow, up to all of them but what closes the last segment."""
    told: list[tuple[int, int]] = []

    verify(log, progress=lambda done, todo: told.append((done, todo)))

    assert all(a[0] < b[0] for a, b in pairwise(told))
    assert {sum(p.stat().st_size for p in log.glob("*.mcap"))} == {todo for _, todo in told}


@pytest.mark.parametrize("commits", [1, 3])
def test_a_keyframe_that_a_retraction_reaches_behind(commits: int, tmp_path: Path) -> None:
    """Keyframes after the retraction are compared with a new fold."""
    from semmap_log.core.model.events import Retracted
    from semmap_log.store.writing import segment_chain

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", commits)
        with sl.create(tmp_path / "log", tz="UTC", compact=False) as opened:
            for _ in range(5):
                opened.add_door()
            opened.append([Retracted(first_event=1, last_event=1)])
            for _ in range(5):
                opened.add_door()
            opened.append([Retracted(first_event=6, last_event=7)])
            for _ in range(4):
                opened.add_door()

    found = verify(tmp_path / "log")

    assert ((), found.segments) == (found.findings, found.keyframes)
    assert found.segments > 4


def test_bits_of_zstd_that_mean_nothing(tmp_path: Path) -> None:
    """In a closed segment the CRC of the data covers them."""
    live = tmp_path / "live"
    for log in (eventful_log(tmp_path / "log", per_segment=50, copy=live), live):
        file = segment(log, 0)
        (chunk,) = [c for c in open_segment(file).chunks if c.compression]
        flip(file, chunk.data_offset + 4, 4)  # the frame header's unused bit

    closed, found = verify(tmp_path / "log"), verify(live)

    assert (4, 13) == (closed.exit_code, closed.events)
    assert (0, 13, "compression") == (found.exit_code, found.events, worst(found).kind)
    assert Severity.WARNING is worst(found).severity
