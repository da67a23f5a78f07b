"""Trimmed logs that were damaged and recovered: commands that are sent again are stored once."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.log.replay.maintenance import copy, recover, recover_into, verify
from semmap_log.log.trimming.trim_log import trim_log
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.repairing import Loss
from semmap_log.store.trimming import remaining_records
from tests.log.trimming.logs import MinuteClock
from tests.log.trimming.test_sent_again import (
    RULES,
    Answers,
    an_id,
    check_known,
    check_sound,
    commands,
    first,
    log,
    sent,
)

__all__ = ["first", "log", "sent"]
pytestmark = pytest.mark.filterwarnings("ignore::semmap_log.errors.HorizonWarning")


class Damage(NamedTuple):
    """What is done to a file of a log."""

    name: str
    change: Callable[[bytes], bytes]

    def do(self, folder: Path) -> None:
        path = folder / self.name
        path.write_bytes(self.change(path.read_bytes()))


def flipped(at: int) -> Callable[[bytes], bytes]:
    return lambda data: data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def damages(log: Path) -> Iterator[Damage]:
    """Yield a flipped byte of each segment's head, chunks and footer, and cuts."""
    for segment in LogReader(log).segments:
        name, size = segment.path.name, segment.size
        places = [1, 150, size - 40, *(c.data_offset + c.stored_size // 2 for c in segment.chunks)]
        yield from (Damage(name, flipped(at)) for at in places)
        ends = [segment.chunks[-1].offset, size - 3] if segment.header.number else [size - 3]
        yield from (Damage(name, lambda data, end=end: data[:end]) for end in ends)


def trim(log: Path, kinds: str) -> None:
    for kind in kinds.split():
        with sl.append(log, compact=False) as opened:
            opened.observe(DoorId(1), "closed")
        trim_log(log, RULES[kind](LogReader(log)))


def check_stored_once(log: Path, first: Answers, losses: Sequence[Loss]) -> None:
    """Send again what was not lost: it is known; what was, is stored."""
    last = sl.read(log).last_event()
    with sl.append(log, clock=MinuteClock(), compact=False) as opened:
        for i, (events, how) in enumerate(commands()):
            if not any(lost(loss, *first[i]) for loss in losses):
                assert opened.append(events, command_id=an_id(i), **how).first_event <= last, i
    assert sl.read(log).last_event() == last


def lost(loss: Loss, first_event: int, count: int) -> bool:
    last = first_event + count if loss.last_event is None else loss.last_event
    return loss.first_event < first_event + count and first_event <= last


@pytest.mark.slow
@pytest.mark.parametrize("kinds", ["thin", "tracks", "notes thin tracks"])
def test_commands_are_known_wherever_the_damage_was(
    log: Path, first: Answers, monkeypatch: pytest.MonkeyPatch, kinds: str
) -> None:
    """But for those that were lost; each chunk holds one commit, or what stands for some."""
    monkeypatch.setattr(remaining_records, "CHUNK_BYTES", 1)
    trim(log, kinds)
    known = [check_recovered(log, first, damage, i) for i, damage in enumerate(damages(log))]
    assert sum(known) > 10


@pytest.mark.parametrize("kinds", ["thin", "tracks"])
@pytest.mark.parametrize("place", [1, 4, 14, 28])
def test_commands_are_known_after_a_recovery(
    log: Path, first: Answers, monkeypatch: pytest.MonkeyPatch, kinds: str, place: int
) -> None:
    """A flipped byte in the head of a trimmed segment, in two of its chunks, and in a later one."""
    monkeypatch.setattr(remaining_records, "CHUNK_BYTES", 1)
    trim(log, kinds)
    check_recovered(log, first, list(damages(log))[place], place)


def check_recovered(log: Path, first: Answers, damage: Damage, i: int) -> bool:
    """Damage a copy of a log, recover it, and send all again; return whether nothing was lost."""
    damaged = Path(shutil.copytree(log, log.with_name(f"{i}")))
    damage.do(damaged)
    found = recover(damaged)
    if found.plan.has_to_do:
        check_sound(damaged)
    check_stored_once(damaged, first, found.plan.losses)
    return not found.plan.losses


@pytest.mark.parametrize("kinds", ["thin", "thin keep", "notes tracks"])
def test_where_nothing_was_lost_all_is_as_it_was(log: Path, first: Answers, kinds: str) -> None:
    """Numbers, hashes, the id; it is compacted, copied, trimmed and recovered again."""
    trim(log, kinds)
    before = verify(log)
    last = sl.read(log).last_event()
    for path in [*log.glob("closed-*.json"), log / "metadata.yaml"]:
        path.unlink()
    for _ in range(2):
        segment = LogReader(log).segments[-1]
        Damage(segment.path.name, flipped(segment.size - 40)).do(log)

        recover(log)

        assert verify(log).log_id == before.log_id
        assert verify(log, ends=[last + 1]).ends[last + 1].head == before.head
        check_sound(log)
        check_known(log, first)
        trim(log, "tracks")
        check_known(log, first)
        last, before = sl.read(log).last_event(), verify(log)

    compact(log)
    copy(log, log.with_name("copy"))
    check_known(log.with_name("copy"), first)


def test_a_copy_of_what_is_whole_knows_its_commands(log: Path, first: Answers) -> None:
    """A log of another id; the numbers after what is lost are others."""
    trim(log, "thin")
    second = LogReader(log).segments[1]
    Damage(second.path.name, flipped(second.chunks[1].data_offset + 20)).do(log)
    target = log.with_name("target")

    found = recover_into(log, target)

    check_sound(target)
    check_stored_once(target, first, found.plan.losses)
    assert verify(target).log_id != found.plan.verification.log_id
    assert sum(one.last_event is not None for one in found.plan.losses) == 1


def test_behind_a_gap_commands_are_known_by_new_numbers(log: Path, first: Answers) -> None:
    """As when they were sent first, but for as many events as are lost before them."""
    trim(log, "thin")
    segment = LogReader(log).segments[0]
    last_of_first = LogReader(log).segments[1].header.first_event - 1
    with sl.append(log, clock=MinuteClock(), compact=False) as opened:
        opened.add_door(x=0.0, y=0.0, theta=0.0, width=0.9)
    Path(segment.path).unlink()

    recover(log)

    behind = [i for i, (number, _) in enumerate(first) if number > last_of_first]
    with sl.append(log, clock=MinuteClock(), compact=False) as opened:
        every = list(commands())
        again = [opened.append(every[i][0], command_id=an_id(i), **every[i][1]) for i in behind]
    moved = [(first[i][0] - last_of_first - 1, first[i][1]) for i in behind]
    assert [(one.first_event, one.count) for one in again] == moved
    assert len(moved) > 5
