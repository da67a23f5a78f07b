"""What is asked of a log: by the public functions, and by every verb.

For a forked child, whose end by a signal is an answer, too.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import re
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import semmap_log as sl
from fault_injection.forking import Ended
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError

Question = Callable[[sl.DoorLog], Any]
Answers = Mapping[str, Any]


def questions(moments: list[int], numbers: list[int]) -> dict[str, Question]:
    """Return what to ask of a log; the first two read every byte that counts."""
    asked: dict[str, Question] = {
        "commits": lambda log: list(log.commits()),
        "events": lambda log: _plain(log.batches_in()),
        "replay": lambda log: repr(log.replay()),
        "history": lambda log: [_text(entry) for entry in log.history()],
        "floor map": lambda log: _text(log.floor_map(1)),
        "end": lambda log: log.end_ns(),
    }
    for ns in moments:
        asked[f"known at {ns}"] = lambda log, ns=ns: repr(log.replay(known_at=ns))
        asked[f"at {ns}"] = lambda log, ns=ns: repr(log.replay(at=ns))
    for number in numbers:
        asked[f"event {number}"] = lambda log, n=number: _text(log.event(n))
        asked[f"entry {number}"] = lambda log, n=number: _text(log.entry(n))
        asked[f"up to {number}"] = lambda log, n=number: repr(log.replay(event=n))
    return asked


def answer(ask: Question, log: sl.DoorLog) -> Any:
    """Return what a log answers; that there is no such event is an answer, too."""
    try:
        return ask(log)
    except (CorruptLogError, NotALogError, LogAccessError):
        raise
    except LogError as error:  # such as: there is no event 12
        return f"{type(error).__name__}: {str(error).removeprefix(str(log.path))}"


def _plain(batches: Iterable[EventBatch]) -> Any:
    """Return batches as values that compare, however they are split: NaN is NaN."""
    stamps: tuple[list[int], ...] = ([], [], [], [])
    columns: dict[int, bytes] = {}
    texts: dict[int, list[str]] = {}
    for batch in batches:
        arrays = (batch.number, batch.kind, batch.happened_ns, batch.recorded_ns)
        for values, array in zip(stamps, arrays, strict=True):
            values.extend(array.tolist())
        for kind, rows in batch.columns.items():
            columns[kind] = columns.get(kind, b"") + rows.tobytes()
        for kind, events in batch.objects.items():
            texts.setdefault(kind, []).extend(map(_text, events))
    return stamps, columns, texts


def _text(value: Any) -> str:
    cells = getattr(getattr(value, "event", value), "cells", None)
    assert cells is None or isinstance(getattr(value, "event", value), FloorMap)
    return repr(value) if cells is None else f"{value!r} {cells.tobytes()!r}"


TRACEBACK = -1
"""The exit code of a verb that ended in an exception of Python's."""
NEVER_ANSWERED = -2
"""The exit code of what was asked, and not answered: the process ended."""
OUT = "{out}"
"""In arguments: a folder for what the verb writes. LOG: the log's."""
LOG = "{log}"
MOST_LISTED = 200_000


@dataclass(frozen=True)
class Answer:
    """What came of one question."""

    code: int
    said: str
    """What it printed, and digests of the files it wrote."""
    error: str = ""
    """What it printed on stderr."""

    @property
    def is_good(self) -> bool:
        """Whether it claims to be an answer."""
        return self.code == 0


Arguments = tuple[str, ...]


def ask_verb(
    arguments: Arguments, log: Path, out: Path, *, fresh: bool = True, last: int | None = None
) -> Answer:
    """Run a verb in this process.

    Args:
        arguments: Of the command line; `LOG` and `OUT` stand for the paths.
        log: The log.
        out: A folder for what is written.
        fresh: Whether that is emptied first.
        last: Keep that many bytes of what it prints, the last ones; None: all.
    """
    if fresh:
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
    real = [part.replace(LOG, str(log)).replace(OUT, str(out)) for part in arguments]
    stdout, stderr = _Captured(), _Captured()
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        code = _run(real)
    said = stdout.text(last)
    if arguments[0] == "info" and code == 0:
        said = _of_events(said)
    error = stderr.text()[-2000:]
    stdout.close()
    stderr.close()
    if code and re.match(r'\{\s*"error": \{', said):  # with --json errors are documents, on stdout
        said, error = "", error + json.loads(said)["error"]["message"]
    return Answer(code, said + _digests(out), error)


class _Captured(io.TextIOWrapper):
    """A stream whose text can be had afterwards; has bytes below it, as a real one has."""

    def __init__(self) -> None:
        file = tempfile.TemporaryFile()  # noqa: SIM115 - closed with this stream
        super().__init__(file, encoding="utf-8", write_through=True)

    def text(self, last: int | None = None) -> str:
        """Return what was written, or the last bytes of it."""
        end = self.buffer.seek(0, io.SEEK_END)
        self.buffer.seek(0 if last is None else max(0, end - last))
        return bytes(self.buffer.read()).decode("utf-8", "replace")


def _run(arguments: list[str]) -> int:
    from semmap_log.cli import main

    _build_verbs_once()
    try:
        main(arguments)
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except BaseException:  # noqa: BLE001 - whatever it is, it is the finding
        print(traceback.format_exc(), file=sys.stderr)
        return TRACEBACK
    return 0


@cache
def _build_verbs_once() -> None:
    """Have typer put its commands together once, not for each question: that takes most time."""
    import typer.main

    typer.main.get_command = cache(typer.main.get_command)


def _of_events(info: str) -> str:
    """Return of `info --json` what is said of the events, not of the files that hold them."""
    try:
        said = json.loads(info)
    except ValueError:
        return info
    names = ("log_id", "doors", "events", "commits", "kinds", "happened", "recorded", "head")
    return json.dumps({name: said.get(name) for name in names})


def _digests(out: Path) -> str:
    files = sorted(path for path in out.rglob("*") if path.is_file())
    lines = [f"{p.relative_to(out)} {hashlib.sha256(p.read_bytes()).hexdigest()}" for p in files]
    return "\n".join(["", *lines]) if lines else ""


VerbQuestion = Callable[[], Answer]


def tell_answers(questions: Mapping[str, VerbQuestion], tell: Callable[[str], object]) -> None:
    """Ask, and tell each answer; for a child process, which may not come to tell all."""
    for name, ask in questions.items():
        tell(json.dumps({"asked": name}))
        answer = ask()
        said = answer.said if len(answer.said) <= MOST_LISTED else _shortened(answer.said)
        tell(json.dumps({"name": name, "code": answer.code, "said": said, "error": answer.error}))


def _shortened(said: str) -> str:
    return f"{said[:1000]} … {hashlib.sha256(said.encode()).hexdigest()}"


def heard_answers(ended: Ended) -> dict[str, Answer]:
    """Return the answers that a child told; of what ended it, too."""
    answers: dict[str, Answer] = {}
    for line in ended.lines:
        told: dict[str, Any] = json.loads(line)
        if "asked" in told:
            error = f"the process ended with {ended.status}: {ended.error}"
            answers[told["asked"]] = Answer(NEVER_ANSWERED, "", error)
        else:
            answers[told["name"]] = Answer(told["code"], told["said"], told["error"])
    return answers


_CLAIMS = re.compile(
    r"there is no event|no door |no such door|unknown door|no such level", re.IGNORECASE
)
"""An error that says this of a log that holds it is a wrong answer, not an error."""


def what_is_wrong(answer: Answer, right: Iterable[Answer], names: Iterable[str]) -> str:
    """Say why an answer is neither right nor an error; empty: it is one of both.

    Args:
        answer: Of a damaged log.
        right: What it may be.
        names: An error names one of these: the log, or its files.
    """
    rights = list(right)
    if any((answer.code, answer.said) == (one.code, one.said) for one in rights):
        return ""
    if answer.code < 0:
        return f"{answer.error.strip()[-600:]}"
    if answer.code == 0:
        return f"another answer, with exit 0: {_difference(rights[0].said, answer.said)}"
    if answer.code == 2:
        return f"a usage error: {answer.error.strip()[-200:]}"
    if "Traceback" in answer.error or "AssertionError" in answer.error:
        return f"exit {answer.code}: {answer.error.strip()[-600:]}"
    said = answer.error + answer.said
    if not any(name in said for name in names):
        return f"exit {answer.code}, and no file is named: {said.strip()[-200:]!r}"
    if _CLAIMS.search(answer.error) and not any(one.code == answer.code for one in rights):
        return f"exit {answer.code}, which claims: {answer.error.strip()[-200:]}"
    return ""


def _difference(one: str, other: str) -> str:
    at = next((i for i, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), 0)
    start = max(0, at - 40)
    return f"expected …{one[start : at + 60]!r}…, got …{other[start : at + 60]!r}…"
