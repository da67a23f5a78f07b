"""Answers of earlier runs, so that a run that was cut goes on, and one that is repeated is short.

They lie where `answer_places` says. One checked file an answer: a line of JSON, and a table in
Arrow's stream format.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.io.checked_file import read_checked, write_checked
from semmap_log.errors import OutputError
from semmap_log.fleet.answer_places import SUFFIX, answer_name, digits_of
from semmap_log.fleet.jobs.job import Holds, Job
from semmap_log.fleet.jobs.log_answer import LogAnswer
from semmap_log.fleet.jobs.log_outcome import AskedLog, LogOutcome

FORMAT = 1
MOST_BYTES = 2**28
"""Of an answer that is kept; a longer one is not."""


class KeptAnswers:
    """The answers to one question."""

    def __init__(self, folder: Path, job: Job) -> None:
        """Look what is there.

        Raises:
            OutputError: The folder cannot be made.
        """
        ours = f"{FORMAT} {version('semmap-log')} {[str(field) for field in job.fields]}"
        asked = f"{ours} {job.name} {job.parameters()}"
        self.folder = folder / f"{job.name}-{digits_of(asked)}"
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)  # who was where
        except OSError as error:
            raise OutputError(
                f"{folder}: answers cannot be kept there: {error.strerror}; name another folder "
                "with --results."
            ) from None
        self._holds = job.holds
        self._files = {path.name.split("-", 1)[0]: path for path in self.folder.glob(f"*{SUFFIX}")}

    def of(self, places: Iterable[str]) -> dict[str, LogAnswer]:
        """Return the answers of these logs, as far as they are there, whole."""
        found = ((place, self.get(place)) for place in places)
        return {place: kept for place, kept in found if kept is not None}

    def get(self, place: str) -> LogAnswer | None:
        """Return the answer of a log; None: there is none that is whole."""
        path = self._files.get(digits_of(place))
        if path is None:
            return None
        data = read_checked(path, MOST_BYTES)
        if data is None:
            return None
        try:
            line, _, table = data.partition(b"\n")
            told = json.loads(line)
            if told["place"] != place:
                return None
            asked = AskedLog(**{**told, "outcome": LogOutcome(told["outcome"])})
            return LogAnswer(replace(asked, is_kept=True), pa.ipc.open_stream(table).read_all())
        except (ValueError, TypeError, KeyError, pa.ArrowException):
            return None

    def keep(self, answer: LogAnswer) -> None:
        """Keep an answer in the place of the log's last one.

        Where that fails, or the answer is too long, the log is asked again by the next run.
        """
        assert answer.table is not None
        asked = answer.asked
        out = pa.BufferOutputStream()
        with pa.ipc.new_stream(out, answer.table.schema) as writer:
            writer.write_table(answer.table)
        body = json.dumps(asdict(asked)).encode() + b"\n" + out.getvalue().to_pybytes()
        if len(body) > MOST_BYTES:
            return
        of = digits_of(asked.place)
        path = self.folder / answer_name(asked.place, asked.log_id, asked.head)
        before = self._files.get(of)
        with suppress(OSError):
            write_checked(path, body)
            self._files[of] = path
            if before not in (None, path):
                before.unlink(missing_ok=True)

    def finish(self) -> None:
        """Say that a run has come to its end: what holds for one run only is not kept."""
        if self._holds is Holds.within_a_run:
            for path in self._files.values():
                with suppress(OSError):
                    path.unlink(missing_ok=True)
            self._files.clear()
