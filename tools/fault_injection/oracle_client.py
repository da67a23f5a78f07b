"""The oracle, a program that shares no code with the log; and verbs, which must agree with it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from fault_injection.questions import Answer, Arguments

PROGRAM = Path(__file__).parent / "oracle"


class Oracle(AbstractContextManager["Oracle"]):
    """The oracle's process, to be asked about many logs, one after the other."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, log: Path, *moments: dict[str, int]) -> dict[str, Any]:
        """Return what the bytes of a log say, and its doors at some moments.

        Args:
            log: Its folder.
            moments: Each an `at`, a `known_at`, an `event`, some of them, or none: now.

        Raises:
            RuntimeError: The oracle itself has failed.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        request = {"log": str(log), "moments": moments}
        self._process.stdin.write(json.dumps(request).encode() + b"\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the oracle ended: {self._process.wait()}")
        found: dict[str, Any] = json.loads(answer)
        return found

    def close(self) -> None:
        """End it."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.wait()


_TIME = re.compile(r"^(?P<seconds>.+)\.(?P<ns>\d{9})Z$")
_OPTIONS = {"--event": "event", "--at": "at", "--known-at": "known_at"}


def disagreements(
    oracle: Oracle, log: Path, verbs: Mapping[str, Arguments], answers: Mapping[str, Answer]
) -> list[str]:
    """Return the questions whose answers by a verb and by the oracle differ.

    Args:
        oracle: Is asked.
        log: The log, whole.
        verbs: Question -> command line; those that the oracle cannot answer are left out.
        answers: Question -> what the verb said of the log.
    """
    replays = {name: _moment(line) for name, line in verbs.items() if line[0] == "replay"}
    found = oracle.ask(log, *replays.values())
    wrong = []
    for name, doors in zip(replays, found["doors"], strict=True):
        said = _timed(json.loads(answers[name].said))
        if {key: said[key] for key in ("event", "levels", "doors")} != doors:
            wrong.append(name)
    judges: dict[str, Callable[[Any, dict[str, Any]], bool]] = {
        "history": lambda said, found: _entries(said) == _expected(found),
        "tail -n 5": lambda said, found: _numbered(said) == _numbered(found["events"][-5:]),
        "info": _is_info,
    }
    for name, is_right in judges.items():
        if not is_right(_read(answers[name].said), found):
            wrong.append(name)
    for name, line in verbs.items():
        if line[0] == "show":
            entry = _read(answers[name].said)
            expected = [e for e in _expected(found) if e["event"] == int(line[2])]
            if _entries([entry]) != expected:
                wrong.append(name)
    return wrong


def _moment(line: Arguments) -> dict[str, int]:
    """Return the moment of a `replay`, as the oracle takes it."""
    options = dict(zip(line[2::2], line[3::2], strict=False))
    moment: dict[str, int] = {}
    for option, name in _OPTIONS.items():
        value = options.get(option, "")
        if value.startswith("event:"):
            moment["event"] = int(value.removeprefix("event:"))
        elif value:
            moment[name] = int(value.removeprefix("@"))
    return moment


def _read(said: str) -> Any:
    """Return JSON, or JSON lines."""
    try:
        return _timed(json.loads(said))
    except ValueError:
        return [_timed(json.loads(line)) for line in said.splitlines()]


def _timed(value: Any) -> Any:
    """Return a value with its times as nanoseconds."""
    if isinstance(value, dict):
        return {name: _timed(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_timed(one) for one in value]
    match = _TIME.match(value) if isinstance(value, str) else None
    if match is None:
        return value
    at = datetime.fromisoformat(match["seconds"]).replace(tzinfo=timezone.utc)
    return int(at.timestamp()) * 10**9 + int(match["ns"])


_SHOWN = ("event", "kind", "door_id", "happened", "recorded")
_NOTED = ("actor", "source", "reason", "correlation", "command_id")


def _numbered(events: list[dict[str, Any]]) -> list[Any]:
    return [[event.get(name) for name in _SHOWN] for event in events]


def _entries(said: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: entry.get(name) for name in (*_SHOWN, *_NOTED, "retracted")} for entry in said]


def _expected(found: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the history as the oracle has it: each event with its commit's note."""
    events = found["events"]
    hidden = [(e["first_event"], e["last_event"]) for e in events if e["kind"] == "Retracted"]
    entries = []
    for commit in found["commits"]:
        first = commit["first_event"]
        note = {name: (commit["note"] or {}).get(name) or None for name in _NOTED[:-1]}
        for event in events[first : first + commit["count"]]:
            is_hidden = any(a <= event["event"] <= b for a, b in hidden)
            entries.append(
                {name: event.get(name) for name in _SHOWN}
                | note
                | {
                    "command_id": commit["command_id"],
                    "retracted": is_hidden and event["kind"] != "Retracted",
                }
            )
    return entries


def _is_info(said: dict[str, Any], found: dict[str, Any]) -> bool:
    return (said["events"], said["commits"], said["head"]) == (
        len(found["events"]),
        len(found["commits"]),
        found["commits"][-1]["hash"],
    )
