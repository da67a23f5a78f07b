"""Joins, exports and recoveries of a log that was trimmed must not invent anything either."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.questions import ask_verb
from fault_injection.trimming.examining import Moment, drawn_moment, shown, wrong_values
from fault_injection.trimming.life import Life, WrongError
from fault_injection.trimming.whole_log import WholeLog
from semmap_log.errors import HorizonError, SemmapError
from semmap_log.store.reading.reader import LogReader

QUESTIONS = 5
NOTHING = "nothing"
"""Damage that is none."""
SHIFT_NS = 64
"""By so much recorded times may move where commits lie that close to each other."""
OF_STATE = ("state", "last_seen", "prob_open", "prob_closed", "width")


def joined(life: Life, dice: random.Random) -> None:
    """Join the log with another of the building, and ask the join."""
    other, join = life.room / "other", life.room / "house.join.json"
    if not other.exists():
        with sl.create(other, tz="UTC", durability="flush", compact=False) as log:
            log.observe(log.add_door(x=9.0, y=2.0, theta=0.0, width=0.9, name="elsewhere"), "open")
    frames = [part for log in (life.path, other) for part in ("--frame", f"{log.name}=0,0,0")]
    logs = dice.sample([str(life.path), str(other)], 2)
    answer = ask_verb(("join", str(join), *logs, *frames, "--json"), life.path, life.out)
    if answer.code:
        raise WrongError(f"join: exit {answer.code}: {answer.error.strip()[-500:]}")
    ids = {each["door"]: door["door"] for door in json.loads(answer.said)["doors"]
           for each in door["of"] if each["log"] == life.path.name}  # fmt: skip
    made = _Derived(sl.read(join), "join", ids, OF_STATE, _horizon_of_join(life.whole))
    made.compare(life.whole, dice)


def _horizon_of_join(whole: WholeLog) -> int:
    """Return from which moment on a join can know all: later if something before is taken back."""
    horizon_ns = whole.horizon_ns
    if horizon_ns < 0:
        return -1
    retractions = [row for row in whole.rows.values() if row["kind"] == "Retracted"]
    for row in sorted(retractions, key=lambda row: int(row["event"])):
        reached = range(row["first_event"], row["last_event"] + 1)
        first_ns = min(whole.commit_of(number).recorded_ns for number in reached)
        if first_ns <= horizon_ns < row["recorded"]:
            horizon_ns = whole.commit_of(row["event"]).closed_ns
    return horizon_ns


def pseudonymous(life: Life, dice: random.Random) -> None:
    """Write the log without names, make a log of that, and ask it."""
    _export(life, dice, "--pseudonymous")


def exported(life: Life, dice: random.Random) -> None:
    """Write the log as lines, make a log of them, and ask it."""
    _export(life, dice)


def _export(life: Life, dice: random.Random, *more: str) -> None:
    lines, made = life.room / "lines.jsonl", life.room / "made"
    shutil.rmtree(made, ignore_errors=True)
    life.verb("export", str(lines), *more)
    for arguments in (("init", str(made), "--tz", "UTC"), ("import", str(made), str(lines))):
        answer = ask_verb(arguments, life.path, life.out)
        if answer.code:
            raise WrongError(f"{arguments[0]} of an export: exit {answer.code}: "
                             f"{answer.error.strip()[-500:]}")  # fmt: skip
    names = (*OF_STATE, "x", "y", "theta", "level") + (() if more else ("annotations",))
    what, ids = " ".join(["import of export", *more]), _same_ids(life.whole)
    horizon_ns = life.whole.horizon_ns
    copy = _Derived(sl.read(made), what, ids, names, horizon_ns, knows_horizon=False)
    copy.compare(life.whole, dice)


def _same_ids(whole: WholeLog) -> dict[int, int]:
    return {row["door_id"]: row["door_id"] for row in whole.rows.values() if "door_id" in row}


def recovered(life: Life, dice: random.Random) -> None:
    """Damage a copy of the log and recover it: what is lost is named, the rest is there."""
    copy = life.room / "damaged"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(life.path, copy, ignore=shutil.ignore_patterns(".lock"))
    files = [
        copy / segment.path.name for segment in LogReader(copy).segments
    ]  # without those merged since
    how = _damage(dice.choice(files), dice)
    life.steps.append(f"recover: {how}")
    answer = ask_verb(("recover", "{log}", "--yes", "--json"), copy, life.out)
    if answer.code < 0 or (answer.code and how == NOTHING):
        raise WrongError(f"recover: exit {answer.code}: {answer.error.strip()[-500:]}")
    if answer.code:  # such as: what stands for all that is gone is damaged itself
        return
    said = json.loads(answer.said)
    spans = [(one["first_event"], one["last_event"]) for one in said["lost"]]
    if any(None in span for span in spans):  # it is not known which events are lost
        return
    lost = {number for first, last in spans for number in range(first, last + 1)}
    whole = _what_is_left(life.whole, lost)
    _send_again(life, copy, lost)
    names = ("state", "annotations")
    log = _Derived(sl.read(copy), "recovered", _same_ids(whole), names, whole.horizon_ns)
    log.compare(whole, dice)


def _damage(file: Path, dice: random.Random) -> str:
    """Flip a bit of a file's second half, cut it there, or leave it alone; return which."""
    data = bytearray(file.read_bytes())
    how, place = dice.choice(("flip", "cut", NOTHING)), dice.randrange(len(data) // 2, len(data))
    if how == NOTHING:
        return how
    if how == "flip":
        data[place] ^= 1 << dice.randrange(8)
    else:
        del data[place:]
    file.write_bytes(data)
    return f"{how} {file.name} {place}"


def _send_again(life: Life, copy: Path, lost: set[int]) -> None:
    """Send a recovered log what was sent before, and is not lost: it stores nothing."""
    for sent in life.sent:
        commit = life.whole.commit_of(sent.number)
        if sent.command.way == "line" or not lost.isdisjoint(commit.numbers):
            continue
        with sl.append(copy, durability="flush", compact=False) as log:
            before = log.last_event()
            try:
                sent.command.send(log)
            except SemmapError as error:
                raise WrongError(
                    f"sent again to a recovered log: {error}: {sent.command}"
                ) from error
            if log.last_event() != before:
                raise WrongError(f"sent again to a recovered log, and stored: {sent.command}")


def _what_is_left(whole: WholeLog, lost: set[int]) -> WholeLog:
    """Return the log without what was lost; nothing stands for sightings that were thinned."""
    if not lost:
        return whole
    left = WholeLog(gone=dict(whole.gone), horizon=whole.horizon)
    lost = lost | {number for number, why in whole.gone.items() if why == "thinned"}
    for commit in whole.commits:
        if rows := [row for row in commit.events if row["event"] not in lost]:
            left.take(replace(commit, events=rows))
    return left


@dataclass(frozen=True)
class _Derived:
    """A log that was made of another, and what it must still answer."""

    log: sl.DoorLog
    what: str
    """What it is, for messages."""
    ids: dict[int, int]
    """Door in the log -> in the one that was made of it."""
    names: Collection[str]
    """What is compared of each door."""
    horizon_ns: int
    """Moments before it may be refused."""
    knows_horizon: bool = True
    """Whether they are: lines do not say it, so what is made of them is not asked."""

    def compare(self, whole: WholeLog, dice: random.Random) -> None:
        """Compare its doors at some moments.

        Raises:
            WrongError: They are not those of the whole log, or are refused for no reason.
        """
        for place in range(QUESTIONS):
            moment = drawn_moment(whole, dice) if place else {}
            moment.pop("event", None)
            later_ns = self.horizon_ns + SHIFT_NS
            is_early = min(moment.values(), default=later_ns) < later_ns
            if is_early and not self.knows_horizon:
                continue
            try:
                found = shown(self.log.replay(**dict[str, Any](moment)))
            except HorizonError as error:
                if not is_early:
                    raise WrongError(f"{self.what}: replay {moment}: {error}") from None
                continue
            self._compare(whole, moment, {one["door_id"]: one for one in found["doors"]})

    def _compare(self, whole: WholeLog, moment: Moment, found: dict[int, dict[str, Any]]) -> None:
        expected = {self.ids[one["door_id"]]: one for one in whole.doors(**moment)["doors"]}
        there = sorted(found.keys() & set(self.ids.values()))
        what = f"{self.what}: replay {moment}"
        if there != sorted(expected):
            raise WrongError(f"{what}: doors {there}, expected {sorted(expected)}")
        for door, one in expected.items():
            values = {name: found[door][name] for name in self.names} | {"door_id": one["door_id"]}
            if abs((values.get("last_seen") or 0) - (one["last_seen"] or 0)) < SHIFT_NS:
                values["last_seen"] = one["last_seen"]
            if wrong := wrong_values(whole, values, {name: one[name] for name in self.names}):
                raise WrongError(f"{what}: door {door}: {wrong}")
