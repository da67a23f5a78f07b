"""What a log is sent: new commands, late ones, retractions, files, and what it holds already."""

from __future__ import annotations

import json
import math
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from typing import Any
from unittest.mock import patch

import numpy as np

import semmap_log as sl
from fault_injection.questions import ask_verb
from fault_injection.trimming.commands import ACTORS, WAYS, Command, Drawn
from fault_injection.trimming.life import Life, Sent, WrongError
from fault_injection.trimming.whole_log import Row
from semmap_log.core.model.events import DoorObserved, Retracted
from semmap_log.errors import CommandReusedError, SemmapError

STEPS_NS = (10**6, 10**6, 20 * 10**9, 300 * 10**9, 2400 * 10**9, 3 * 3600 * 10**9)


def write(life: Life, dice: random.Random) -> None:
    """Append some commits, in one of the ways."""
    _send_some(life, dice, lambda drawn, way: drawn.command(way))


def late(life: Life, dice: random.Random) -> None:
    """Report late: what happened among what is thinned, expired, or there."""
    _send_some(life, dice, lambda drawn, way: drawn.late(way), most=3)


def _send_some(
    life: Life, dice: random.Random, draw: Callable[[Drawn, str], Command], most: int = 8
) -> None:
    way, count = dice.choice(WAYS), dice.randint(1, most)
    if way == "line":
        drawn = _drawn(life, dice)
        _record(life, [draw(drawn, way) for _ in range(count)])
        return
    with life.append() as log:
        for _ in range(count):
            life.clock.now_ns += dice.choice(STEPS_NS)
            command = draw(_drawn(life, dice), way)
            if command.events:
                _send(life, log, command)


def _drawn(life: Life, dice: random.Random) -> Drawn:
    return Drawn(dice, life.whole, life.clock.now_ns)


def _send(life: Life, log: sl.DoorLogWriter, command: Command) -> None:
    """Send a new command by Python."""
    life.steps.append(str(command))
    try:
        number = command.send(log)
    except SemmapError as error:
        _check_refusal(life, command, error)
        return
    _check_stored(life, command, number)


def _record(life: Life, commands: Sequence[Command]) -> None:
    """Send new commands as lines to `record`."""
    commands = [command for command in commands if command.events]
    answers = _answers(life, commands)
    for command, answer in zip(commands, answers, strict=True):
        if "event" in answer:
            _check_stored(life, command, answer["event"])
    for command, answer in zip(commands, answers, strict=True):
        if "error" in answer:
            _check_refusal(life, command, answer["error"])


def _answers(life: Life, commands: Sequence[Command]) -> list[dict[str, Any]]:
    """Return what `record` answers to lines."""
    lines = [command.line() for command in commands]
    life.steps += [f"record: {line}" for line in lines]
    file = life.room / "lines"
    file.write_text("".join(f"{line}\n" for line in lines))
    with file.open() as stdin, patch.object(sys, "stdin", stdin):
        said = ask_verb(("record", "{log}", "--ack"), life.path, life.out)
    answers = [json.loads(line) for line in said.said.splitlines()]
    if said.code < 0 or len(answers) != len(lines):
        raise WrongError(f"record: exit {said.code}: {said.error.strip()[-500:]}")
    return sorted(answers, key=lambda answer: int(answer["line"]))


def _check_refusal(life: Life, command: Command, error: object) -> None:
    """Check that a command was refused for what is gone, and that nothing was stored."""
    if rows := life.take_in():
        raise WrongError(f"refused, and stored {rows}: {command}")
    if _may_refuse(life, command):
        life.steps.append(f"(refused: {error})")
        return
    raise WrongError(f"refused, though nothing that it needs is gone: {command}: {error}")


def _may_refuse(life: Life, command: Command) -> bool:
    """Tell whether a command needs to know what is gone."""
    for row in command.rows():
        if row["kind"] == "Retracted" and life.may_refuse_retraction(row["first_event"]):
            return True
        known = {"event": life.whole.last + 1, "recorded": life.clock.now_ns}
        if life.whole.may_refuse_event({"happened": life.clock.now_ns} | known | row):
            return True
    return False


def _check_stored(life: Life, command: Command, number: int) -> None:
    """Check that the next commit is what was sent; other lines may follow it."""
    found = life.next_commits()
    if not found:
        raise WrongError(f"answered as stored, and is not there: {command}")
    life.whole.take(found[0])
    for row, wanted in zip(found[0].events, command.rows(), strict=True):
        if not _same(wanted, {name: row[name] for name in wanted}):
            raise WrongError(f"stored as {row}: {command}")
    if number != found[0].first:
        raise WrongError(f"answered with event {number}, stored as {found[0].first}: {command}")
    if command.command_id is not None:
        life.sent.append(Sent(command, number))


def retract(life: Life, dice: random.Random) -> None:
    """Take something back, in one of the ways; all go by the same rule."""
    hidden = life.whole.hidden() | life.whole.from_trimming
    can = [number for number, row in life.whole.rows.items()
           if number not in hidden and row["kind"] != "Retracted"
           and not (row["kind"] == "MomentPinned" and number in life.whole.gone)]  # fmt: skip
    if not can:
        return
    near = [n for n in can if n in life.whole.gone or n < life.whole.horizon]
    first = dice.choice(near if near and dice.random() < 0.5 else can)
    last = first
    while dice.random() < 0.3 and last + 1 in can:
        last += 1
    event = Retracted(first_event=first, last_event=last)
    way = dice.choice((*WAYS, "verb"))
    command_id = dice.randbytes(16) if dice.random() < 0.5 else None
    command = Command((event,), dice.choice(ACTORS), command_id, way)
    if way == "line":
        _record(life, [command])
    elif way == "verb":
        _retract_by_verb(life, command, first, last)
    else:
        with life.append() as log:
            _send(life, log, command)


def _retract_by_verb(life: Life, command: Command, first: int, last: int) -> None:
    more = [] if command.command_id is None else ["--command-id", command.command_id.hex()]
    by = ["--actor", command.actor] if command.actor else []
    answer = life.verb("retract", f"{first}..{last}", "--json", *by, *more, good=False)
    if answer.code:
        _check_refusal(life, command, answer.error)
    else:
        _check_stored(life, replace(command, way="method"), life.whole.last + 1)


def large(life: Life, dice: random.Random) -> None:
    """Append many sightings as one commit: of more than a chunk, often of several keyframes."""
    doors = [door["door_id"] for door in life.whole.doors()["doors"]]
    if not doors:
        return
    count = dice.choice((60, 150, 300))
    end_ns, step = life.clock.now_ns, dice.choice((10**6, 10**9, 30 * 10**9))
    random_of = np.random.default_rng(dice.randrange(2**32))
    columns = {
        "door_id": random_of.choice(np.array(doors, np.uint32), count),
        "state": random_of.choice(np.array([1, 1, 1, 2], np.uint8), count),
        "happened_ns": end_ns - step * np.arange(count)[::-1],
    }
    batch = sl.EventBatch.of(DoorObserved, **columns)
    events = tuple(recorded.event for recorded in batch)
    command = Command(events, "", dice.randbytes(16), "append")
    with life.append() as log:
        _send(life, log, command)


def import_file(life: Life, dice: random.Random) -> None:
    """Import a file of states, or one that was imported before: that stores nothing."""
    if life.files and dice.random() < 0.5:
        file = dice.choice(life.files)
        life.verb("import", str(file))
        if rows := life.take_in():
            raise WrongError(f"{file.name} was imported before, and stored {len(rows)} events")
        return
    doors = [door for door in life.whole.doors()["doors"] if door["name"] in {"front", "store"}]
    if not doors or len({door["name"] for door in doors}) < len(doors):
        return
    file = life.room / f"doors_{len(life.files)}.csv"
    rows = _drawn_rows(life, dice, doors)
    file.write_text("\n".join(["timestamp,door,state", *map(_csv_line, rows), ""]))
    answer = life.verb("import", str(file), good=False)
    if answer.code and any(map(life.whole.may_refuse_event, rows)):
        life.take_in()
        return
    if answer.code:
        raise WrongError(f"import: {answer.error.strip()[-500:]}")
    before = {line for earlier in life.files for line in earlier.read_text().splitlines()}
    new = [row for row in rows if _csv_line(row) not in before]  # the same row counts once
    if len(life.take_in()) < len(new):
        raise WrongError("an import that stored less than its file")
    life.files.append(file)


def _drawn_rows(life: Life, dice: random.Random, doors: list[dict[str, Any]]) -> list[Row]:
    """Return sightings of the last minutes, a minute apart, as the log may store them."""
    count = dice.choice((3, 40, 120))
    first_s = life.clock.now_ns // 10**9 - 60 * count
    rows: list[Row] = []
    for i in range(count):
        door = dice.choice(doors)
        rows.append({"kind": "DoorObserved", "door_id": door["door_id"], "name": door["name"],
                     "state": dice.choice((1, 1, 1, 2)), "happened": (first_s + 60 * i) * 10**9,
                     "event": life.whole.last + 1, "recorded": life.clock.now_ns})  # fmt: skip
    return rows


def _csv_line(row: Row) -> str:
    when = datetime.fromtimestamp(row["happened"] // 10**9, timezone.utc).isoformat()
    return f"{when},{row['name']},{'open' if row['state'] == 1 else 'closed'}"


def resend(life: Life, dice: random.Random) -> None:
    """Send again what is stored: the answer is that of the first time, and nothing is stored."""
    for _ in range(min(len(life.sent), dice.randint(1, 4))):
        one = dice.choice(life.sent)
        try:
            number = _sent_again(life, one.command)
        except SemmapError as error:
            life.take_in()
            raise WrongError(f"sent again, and refused: {error}: {one.command}") from error
        rows = life.take_in()
        if rows or number != one.number:
            kinds = [row["kind"] for row in rows]
            raise WrongError(f"sent again, answered with event {number}, not {one.number}, "
                             f"stored {kinds}: {one.command}")  # fmt: skip


def other(life: Life, dice: random.Random) -> None:
    """Send another command under an id that is stored: it is refused."""
    if not life.sent:
        return
    one = dice.choice(life.sent)
    try:
        number = _sent_again(life, one.command.other())
    except CommandReusedError:
        if rows := life.take_in():
            raise WrongError(f"refused, and stored {rows}") from None
    else:
        life.take_in()
        raise WrongError(f"another command under the id of event {one.number}, {one.command}, "
                         f"is answered with event {number}")  # fmt: skip


def _sent_again(life: Life, command: Command) -> int:
    life.steps.append(f"again: {command}")
    if command.way == "line":
        (answer,) = _answers(life, [command])
        if "error" in answer:
            raise CommandReusedError(answer["error"])
        return int(answer["event"])
    with life.append() as log:
        return command.send(log)


def _same(one: Row, other: Row) -> bool:
    return all(a == b or (_is_nan(a) and _is_nan(b))
               for a, b in ((one[name], other[name]) for name in one))  # fmt: skip


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)
