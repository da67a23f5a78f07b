"""What somebody who can write to a signed log, without its keys, may do; and the exit code.

Each attack takes a copy of the log, and what is random. What can be made to fit is made to fit, up
to the event that tells of the trimming; so that `verify` without a key finds nothing wrong where
the attack says so.
"""

from __future__ import annotations

import hashlib
import random
import shutil
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import semmap_log as sl
from fault_injection.signed_logs.forging import (
    KEYFRAME,
    NOTE,
    OBSERVED,
    TOMBSTONE,
    Commit,
    Forgery,
    Record,
    SegmentParts,
    tell_of_trimming,
)
from fault_injection.signed_logs.sample import SignedSample, append_some
from semmap_log.log.signing.background_signer import BackgroundSigner
from semmap_log.log.signing.log_signing import sign
from semmap_log.log.trimming.redaction import Notes, Redaction, Tracks
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.header import Trimmed, TrimReason
from semmap_log.store.reading.reader import LogReader


@dataclass
class Scene:
    """A copy of the sample, and what is random."""

    sample: SignedSample
    log: Path
    dice: random.Random
    elsewhere: tuple[Path, ...] = ()
    """Statements that were kept outside of the log."""

    def forgery(self) -> Forgery:
        """Return the log taken apart."""
        return Forgery(self.log)

    def pick(self, found: list[Commit]) -> Commit:
        """Return any of some commits."""
        assert found, "the sample has such a commit"
        return self.dice.choice(found)

    def put_back(self, stage: Path) -> None:
        """Put an earlier state of the log in its place."""
        shutil.rmtree(self.log)
        shutil.copytree(stage, self.log)

    def statements(self, suffix: str = ".head") -> list[Path]:
        """Return the statements in the log's folder, the first first."""
        return sorted((self.log / "signatures").glob(f"*{suffix}"))


@dataclass(frozen=True)
class Attack:
    """What is done, and what `verify --public-key` says of it."""

    name: str
    code: int
    kinds: frozenset[str]
    """Of the findings: one of these is there."""
    fits: bool
    """Whether `verify` without a key finds nothing wrong."""
    is_no_more: bool
    """Whether nothing is wrong once the robot has read and signed the log."""
    do: Callable[[Scene], None]


ATTACKS: list[Attack] = []


def attack(
    code: int, *kinds: str, fits: bool = False, is_no_more: bool = False
) -> Callable[..., Callable[[Scene], None]]:
    """Take a function for an attack."""

    def take(do: Callable[[Scene], None]) -> Callable[[Scene], None]:
        name = do.__name__.replace("_", " ")
        ATTACKS.append(Attack(name, code, frozenset(kinds), fits, is_no_more, do))
        return do

    return take


def turned(record: Record) -> None:
    """Have a sighting say the opposite."""
    record.say(state=3 - record.said["state"])


def reassessed(record: Record) -> None:
    """Have a sighting count for less; no keyframe tells."""
    record.say(accuracy_open=0.5)


def lacking(forgery: Forgery, channel: int, left: int = 1) -> list[Commit]:
    """Return commits that lack records of a channel, and have so many of it left."""
    return [
        one for one in forgery.commits
        if one.lacks is not None and channel in one.lacks.said["channel"].tolist()
        and len(one.of(channel)) >= left
    ]  # fmt: skip


def untouched(forgery: Forgery) -> list[Commit]:
    """Return whole commits with sightings."""
    return whole(forgery.commits)


# What was recorded.


@attack(4, "taken-out", fits=True)
def state_of_a_kept_record_turned_in_a_trimmed_commit(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick(lacking(forgery, OBSERVED))
    turned(scene.dice.choice(commit.of(OBSERVED)))
    commit.make_fit()
    forgery.write()


@attack(4, "taken-out", fits=True)
def happened_time_of_a_kept_record(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick(lacking(forgery, OBSERVED))
    scene.dice.choice(commit.of(OBSERVED)).publish_ns -= 1 + scene.dice.randrange(10**12)
    commit.make_fit()
    forgery.write()


@attack(4, "taken-out", fits=True)
def data_of_two_kept_records_swapped(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick(lacking(forgery, OBSERVED, 2))
    first, second = scene.dice.sample(commit.of(OBSERVED), 2)
    first.data, second.data = second.data, first.data
    turned(first)
    commit.make_fit()
    forgery.write()


@attack(4, "commit")
def state_turned_in_an_untouched_commit(scene: Scene) -> None:
    forgery = scene.forgery()
    turned(scene.dice.choice(scene.pick(untouched(forgery)).of(OBSERVED)))
    forgery.write(tells=False)


@attack(4, "rewritten", "taken-out", fits=True)
def another_branch_from_a_commit_on_all_hashes_fit(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick(untouched(forgery))
    reassessed(scene.dice.choice(commit.of(OBSERVED)))
    forgery.hash_from(commit)
    forgery.write()


@attack(4, "commit", "chain", "time")
def a_record_told_twice(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick(lacking(forgery, OBSERVED))
    again = scene.dice.choice(commit.of(OBSERVED))
    commit.records.insert(commit.records.index(again), again)
    commit.make_fit()
    forgery.write(tells=False)


@attack(4, "commit")
def words_put_into_a_blank_note(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick(lacking(forgery, NOTE))
    commit.of(NOTE)[0].say(actor="carl", reason="it was me")
    commit.make_fit()
    forgery.write(tells=False)


@attack(4, "commit")
def command_id_of_a_commit(scene: Scene) -> None:
    forgery = scene.forgery()
    end = scene.pick(untouched(forgery)).end
    assert end is not None
    end.data = end.data[:30] + bytes([end.data[30] ^ 1]) + end.data[31:]
    forgery.write(tells=False)


# Tombstones.


@attack(4, "commit", "missing", "trimmed")
def tombstone_of_a_commit_removed(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick([one for one in forgery.commits if one.lacks])
    commit.records.remove(commit.of(TOMBSTONE)[0])
    forgery.write(tells=False)


@attack(4, "taken-out", fits=True)
def commits_before_a_gone_run_rewritten_hashes_too(scene: Scene) -> None:
    forgery = scene.forgery()
    runs = [i for i, one in enumerate(forgery.commits) if one.gone]
    before = [one for one in forgery.commits[: max(runs)] if one.end]
    commit = scene.pick(before)
    end = commit.end
    assert end is not None
    end.data = end.data[:30] + bytes([end.data[30] ^ 1]) + end.data[31:]
    forgery.hash_from(commit)
    forgery.write()


@attack(4, "taken-out", fits=True)
def a_tombstone_of_whole_commits_cuts_the_chain(scene: Scene) -> None:
    """The forged commits before it have none."""
    forgery = scene.forgery()
    segment = scene.dice.choice([
        one for one in forgery.segments[:-1]
        if one.header.trimmed is None and len(whole(one.commits)) > 2
    ])  # fmt: skip
    found = whole(segment.commits)
    gone = found[-2]
    end = gone.end
    assert end is not None
    first, count = end.numbers
    fields = {
        "first_event": first, "count": count, "commits": 1, "events_gone": count,
        "notes_gone": len(gone.of(NOTE)), "reasons": 1, "previous_hash": end.data[-64:-32],
        "hash": end.hash, "channel": [], "digest": b"", "kept_digest": b"",
    }  # fmt: skip
    reassessed(scene.dice.choice(found[0].of(OBSERVED)))
    tombstone = Record(TOMBSTONE, first + count - 1, end.log_ns, end.log_ns, b"")
    tombstone.data = tombstone_data(fields)
    segment.commits[segment.commits.index(gone)] = Commit([tombstone])
    made_trimmed(segment, forgery)
    start = segment.commits.index(found[0])
    forgery.hash_from(segment.commits[start])
    forgery.write()


@attack(4, "taken-out", fits=True)
def a_gone_run_told_one_commit_longer(scene: Scene) -> None:
    forgery = scene.forgery()
    run = scene.pick([one for one in forgery.commits if one.gone])
    run.records[-1].say(commits=run.records[-1].said["commits"] + 1)
    forgery.write()


@attack(4, "tombstone", "missing", "commit", "chain")
def a_gone_run_told_with_more_events(scene: Scene) -> None:
    forgery = scene.forgery()
    run = scene.pick([one for one in forgery.commits if one.gone])
    said = run.records[-1].said
    run.records[-1].say(count=said["count"] + 3, events_gone=said["events_gone"] + 3)
    forgery.write(tells=False)


@attack(4, "taken-out", fits=True)
def reason_in_a_tombstone_changed(scene: Scene) -> None:
    forgery = scene.forgery()
    commit = scene.pick([one for one in forgery.commits if one.of(TOMBSTONE)])
    tombstone = commit.of(TOMBSTONE)[0]
    tombstone.say(reasons=1 if tombstone.said["reasons"] != 1 else 4)
    forgery.write()


@attack(4, "taken-out", fits=True)
def the_seal_of_a_command_that_went_changed(scene: Scene) -> None:
    forgery = scene.forgery()
    runs = [one for one in forgery.commits if one.gone and len(one.records[-1].said["channel"])]
    tombstone = scene.pick(runs).records[-1]
    seals = bytearray(bytes(tombstone.said["kept_digest"]))
    seals[scene.dice.randrange(14)] ^= 1
    tombstone.say(kept_digest=bytes(seals))
    forgery.write()


@attack(4, "tombstone")
def a_tombstone_with_nothing_gone(scene: Scene) -> None:
    """It vouches for forged records: nothing of the commit is missing."""
    forgery = scene.forgery()
    trimmed = [one for one in forgery.segments if one.header.trimmed is not None]
    found = [one for segment in trimmed for one in segment.commits]
    commit = scene.pick([one for one in found if one.end and not one.lacks and one.of(OBSERVED)])
    end = commit.end
    assert end is not None
    first, count = end.numbers
    digests = commit.digests()
    turned(commit.of(OBSERVED)[0])
    fields = {
        "first_event": first, "count": count, "commits": 0, "events_gone": 0, "notes_gone": 0,
        "reasons": 1, "previous_hash": bytes(32), "hash": bytes(32), "channel": [OBSERVED],
        "digest": digests[OBSERVED], "kept_digest": commit.digests()[OBSERVED],
    }  # fmt: skip
    time_ns = end.log_ns - 1 - len(commit.of(NOTE))
    tombstone = Record(TOMBSTONE, first + count - 1, time_ns, time_ns, tombstone_data(fields))
    place = commit.records.index((commit.of(NOTE) or [end])[0])
    commit.records.insert(place, tombstone)
    forgery.write(tells=False)
    forge_telling(scene.log)


# What was taken out.


@attack(4, "taken-out", fits=True)
def more_records_taken_out_without_the_key(scene: Scene) -> None:
    part = scene.dice.choice([Tracks(), Notes("bert"), Notes()])
    before = LogReader(scene.log).last_event() + 1
    trim_log(scene.log, Redaction.of(LogReader(scene.log), [part], before))


@attack(4, "taken-out", fits=True)
def whole_commits_taken_out_without_the_key(scene: Scene) -> None:
    reader = LogReader(scene.log)
    trim_log(scene.log, Retention(reader, reader.last_log_time_ns()))


@attack(4, "taken-out", fits=True)
def taken_out_and_signed_with_the_robot_s_key(scene: Scene) -> None:
    whole_commits_taken_out_without_the_key(scene)
    sign(scene.log, scene.sample.robot, trimmed=True)


@attack(4, "signer", fits=True)
def taken_out_and_signed_by_a_stranger(scene: Scene) -> None:
    whole_commits_taken_out_without_the_key(scene)
    sign(scene.log, scene.sample.stranger, trimmed=True)


@attack(4, "taken-out", fits=True)
def what_was_taken_out_put_back(scene: Scene) -> None:
    """Old copies of the segments, which the chain of the others follows."""
    untrimmed, redacted = scene.sample.stages[:2]
    scene.put_back(redacted)
    trimmed = [one for one in LogReader(redacted).segments if one.header.trimmed is not None]
    for segment in trimmed:
        shutil.copy2(untrimmed / segment.path.name.replace(redacted.name, "log"), scene.log)
    for file in (*scene.log.glob("closed-*.json"), scene.log / "metadata.yaml"):
        file.unlink()
    tell_of_trimming(scene.log)


@attack(4, "taken-out", fits=True)
def keyframe_at_the_horizon_forged(scene: Scene) -> None:
    forgery = scene.forgery()
    horizon = LogReader(scene.log).horizon
    frames = [one for one in forgery.commits if one.records[-1].channel == KEYFRAME]
    forge_keyframe(next(one for one in frames if one.records[-1].said["event"] == horizon - 1))
    forgery.write(tells=False)


@attack(4, "taken-out", fits=True)
def a_keyframe_in_a_trimmed_segment_forged(scene: Scene) -> None:
    forgery = scene.forgery()
    trimmed = [one for one in forgery.segments if one.header.trimmed is not None]
    frames = [one for segment in trimmed for one in segment.commits]
    frames = [one for one in frames if one.records[-1].channel == KEYFRAME]
    forge_keyframe(scene.pick([one for one in frames if one.records[-1].said["event"] >= 0]))
    forgery.write(tells=False)


@attack(4, "taken-out", fits=True)
def the_keyframe_after_a_trimmed_segment_forged(scene: Scene) -> None:
    forgery = scene.forgery()
    pairs = zip(forgery.segments, forgery.segments[1:], strict=False)
    after = [b for a, b in pairs if a.header.trimmed is not None and b.header.trimmed is None]
    segment = scene.dice.choice(after)
    forge_keyframe(segment.commits[0])
    segment.commits = [segment.commits[0]] + [
        one for one in segment.commits[1:] if one.records[-1].channel != KEYFRAME
    ]
    forgery.write(tells=False)


@attack(4, "taken-out", fits=True)
def horizon_moved_to_hide_or_to_show_what_is_kept(scene: Scene) -> None:
    forgery = scene.forgery()
    first = forgery.segments[0]
    trimmed = first.header.trimmed
    assert trimmed is not None
    frames = [one.records[-1] for one in first.commits if one.records[-1].channel == KEYFRAME]
    others = {0, *(one.said["event"] + 1 for one in frames)} - {trimmed.horizon}
    horizon = scene.dice.choice(sorted(others))
    first.header = replace(first.header, trimmed=replace(trimmed, horizon=horizon))
    forgery.write(tells=False)


@attack(4, "taken-out", fits=True)
def time_zone_in_the_heads_changed(scene: Scene) -> None:
    forgery = scene.forgery()
    entry = scene.dice.choice(["timezone", "building", "robot"])
    text = "Asia/Tokyo" if entry == "timezone" else "elsewhere"
    for segment in forgery.segments:
        info = replace(segment.header.info, **{entry: text})
        segment.header = replace(segment.header, info=info)
    forgery.write(tells=False)


# The end.


@attack(6, "unsigned", fits=True)
def a_commit_added_without_the_key_closed(scene: Scene) -> None:
    with sl.append(scene.log, compact=False) as log:
        append_some(log, scene.dice, scene.dice.randrange(9))


@attack(6, "unsigned", fits=True)
def a_commit_added_without_the_key_live(scene: Scene) -> None:
    with sl.append(scene.log, compact=False) as log:
        append_some(log, scene.dice, scene.dice.randrange(9))
        live = Path(shutil.copytree(scene.log, scene.log.with_name("live")))
    scene.put_back(live)


@attack(6, "unsigned", fits=True)
def added_without_the_key_then_the_robot_opens_and_signs(scene: Scene) -> None:
    a_commit_added_without_the_key_closed(scene)
    signer = BackgroundSigner(scene.log, scene.sample.robot, every_s=3600)
    with signer, sl.append(scene.log, compact=False, signer=signer) as log:
        append_some(log, scene.dice, 1)
    assert not signer.is_all_signed


@attack(6, "adopted", fits=True)
def added_without_the_key_then_the_robot_adopts_it(scene: Scene) -> None:
    a_commit_added_without_the_key_closed(scene)
    signer = BackgroundSigner(scene.log, scene.sample.robot, every_s=3600, adopt=True)
    with signer, sl.append(scene.log, compact=False, signer=signer) as log:
        append_some(log, scene.dice, 1)
    assert signer.is_all_signed


@attack(4, "taken-out", fits=True)
def added_and_trimmed_in_the_unsigned_end(scene: Scene) -> None:
    with sl.append(scene.log, compact=False) as log:
        for _ in range(3):
            append_some(log, scene.dice, 3)
    last = LogReader(scene.log).last_event()
    trim_log(scene.log, Redaction.of(LogReader(scene.log), [Tracks()], last + 1))


@attack(4, "taken-out", fits=True, is_no_more=True)
def a_trimming_told_of_in_the_unsigned_end(scene: Scene) -> None:
    tell_of_trimming(scene.log)


@attack(4, "rollback", fits=True)
def last_commits_cut_statements_kept(scene: Scene) -> None:
    forgery = scene.forgery()
    last = forgery.segments[-1]
    many = [one for one in last.commits if one.end]
    for one in many[scene.dice.randrange(len(many)) :]:
        last.commits.remove(one)
    forgery.write(live=True, tells=False)


@attack(4, "rollback", fits=True)
def an_older_state_with_its_statements_copies_elsewhere(scene: Scene) -> None:
    scene.elsewhere = (Path(shutil.move(scene.log / "signatures", scene.log.with_name("kept"))),)
    scene.put_back(scene.dice.choice(scene.sample.stages))


# Statements.


@attack(4, "signature", fits=True)
def a_statement_s_text_changed(scene: Scene) -> None:
    file = scene.dice.choice(scene.statements())
    text = file.read_text()
    field = scene.dice.choice(["taken: ", "head: ", "number: ", "next-event: ", "before: "])
    at = text.index(field) + len(field)
    file.write_text(text[:at] + ("1" if text[at] != "1" else "2") + text[at + 1 :])


@attack(4, "signer", fits=True)
def all_rewritten_and_signed_by_a_stranger(scene: Scene) -> None:
    another_branch_from_a_commit_on_all_hashes_fit(scene)
    shutil.rmtree(scene.log / "signatures")
    sign(scene.log, scene.sample.stranger, trimmed=True)


@attack(4, "statement", fits=True)
def statements_of_another_log_of_the_robot(scene: Scene) -> None:
    for file in (scene.sample.other / "signatures").iterdir():
        shutil.copy2(file, scene.log / "signatures")


@attack(4, "statement", fits=True)
def a_statement_in_the_middle_removed(scene: Scene) -> None:
    scene.dice.choice(scene.statements()[:-1]).unlink()


@attack(4, "taken-out", fits=True)
def an_officer_s_statement_put_back_to_an_older_one(scene: Scene) -> None:
    for file in scene.statements(".trim")[-1:]:
        file.unlink()


@attack(4, "unsigned", fits=True)
def all_statements_removed(scene: Scene) -> None:
    shutil.rmtree(scene.log / "signatures")


@attack(4, "fork", fits=True)
def the_key_cloned_and_used_on_two_copies(scene: Scene) -> None:
    copy = Path(shutil.copytree(scene.log, scene.log.with_name("clone")))
    state = scene.sample.keys / "robot.state"
    before = state.read_bytes()
    for log, number in ((copy, 2), (scene.log, 3)):
        state.write_bytes(before)
        with sl.append(log, compact=False) as opened:
            append_some(opened, scene.dice, number)
        sign(log, scene.sample.robot)
    scene.elsewhere = (copy / "signatures",)


@attack(4, "signer", fits=True)
def a_statement_for_one_purpose_put_as_one_for_the_other(scene: Scene) -> None:
    sign(scene.log, scene.sample.officer)  # in the namespace of recorders, in which nobody...
    with sl.append(scene.log, compact=False) as log:
        append_some(log, scene.dice, 1)
    sign(scene.log, scene.sample.officer)  # ... believes the officer


# Helpers.


def whole(commits: list[Commit]) -> list[Commit]:
    """Return those of some commits that are whole, and have sightings."""
    return [one for one in commits if one.end and not one.lacks and one.of(OBSERVED)]


def tombstone_data(fields: dict[str, object]) -> bytes:
    """Return the CDR bytes of a Tombstone, written by hand."""
    channel = fields["channel"]
    assert isinstance(channel, list)
    data = struct.pack(
        "<QQI4xQIB", fields["first_event"], fields["count"], fields["commits"],
        fields["events_gone"], fields["notes_gone"], fields["reasons"],
    )  # fmt: skip
    data += bytes(fields["previous_hash"]) + bytes(fields["hash"])  # type: ignore[call-overload]
    data += bytes(-len(data) % 4) + struct.pack("<I", len(channel))
    data += struct.pack(f"<{len(channel)}H", *channel)
    for name in ("digest", "kept_digest"):
        joined = bytes(fields[name])  # type: ignore[call-overload]
        data += bytes(-len(data) % 4) + struct.pack("<I", len(joined)) + joined
    return b"\0\1\0\0" + data


def made_trimmed(segment: SegmentParts, forgery: Forgery) -> None:
    """Have a segment's head say that something was taken out of it."""
    after = forgery.segments[forgery.segments.index(segment) + 1]
    trimmed = Trimmed(TrimReason.REDACTED, after.header.first_event)
    segment.header = replace(segment.header, trimmed=trimmed)


def forge_keyframe(commit: Commit) -> None:
    """Turn the states of doors in a keyframe; its own hash fits."""
    record = commit.records[-1]
    states = record.said["state"].copy()
    known = (states == 1) | (states == 2)
    assert known.any(), "a door's state is known there"
    states[known] = 3 - states[known]
    record.say(state=states, state_hash=bytes(32))
    record.data = record.data[:16] + hashlib.sha256(record.data).digest() + record.data[48:]


def forge_telling(log: Path) -> None:
    """Tell of the trimming, if the product opens the log for that."""
    try:
        tell_of_trimming(log)
    except sl.SemmapError:
        return
