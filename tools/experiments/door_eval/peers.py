"""Estimators that are programs of their own, in a Python of their own, asked through files.

A peer is a command that reads a JSON line a question from its standard input, and writes a JSON
line for each to its standard output, in order:

    {"door": 3, "ask": "/tmp/x/3.npz", "answer": "/tmp/x/3.npy"}   ->   {"door": 3}

`ask` holds arrays about one door: `start_ns`, `end_ns` and `is_open` of the stretches in which its
state is known all through; `seen_ns`, `reads_open`, `accuracy_open` and `accuracy_closed` of the
sightings; `times_ns` and `known_ns` of the forecasts, all times in nanoseconds since 1970. Nothing
in it is later than the last of `known_ns`. The peer writes P(open) of each forecast to `answer`, as
numpy saves it. A forecast may use only what is not later than its `known_ns`, and settings only
what is not later than the first of them. Instead of an answer it may tell what is wrong:
`{"error": "..."}`. Its standard error goes to the terminal.

`tools/experiments/door_peers` has peers that keep to this.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from semmap_log.analysis.probabilities.estimator import Times
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast, Probabilities
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.errors import EstimatorError

if TYPE_CHECKING:
    from typing_extensions import Self

EVIDENCE = (
    "start_ns", "end_ns", "is_open", "seen_ns", "reads_open", "accuracy_open", "accuracy_closed",
)  # fmt: skip
"""What of the evidence a peer is told."""


class Peer:
    """An estimator that asks a program; it runs until the end of the `with` block."""

    def __init__(self, name: str, command: str) -> None:
        """Take a program, which is started with the block.

        Args:
            name: What the tables call it.
            command: As a shell would be given it.
        """
        self.name = name
        self._command = shlex.split(command)
        self._process: subprocess.Popen[str] | None = None
        self._room = tempfile.TemporaryDirectory(prefix="door_peer_")

    def __enter__(self) -> Self:
        try:
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        except (OSError, IndexError) as error:
            self._room.cleanup()
            raise EstimatorError(f"peer {self.name}: cannot be started: {error}.") from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process is not None:
            with self._process, suppress(BrokenPipeError):  # it ended: that was said already
                self._pipe(self._process.stdin).close()
        self._room.cleanup()

    def learn(
        self,
        evidence: Mapping[DoorId, DoorEvidence],
        clock: LocalClock,  # noqa: ARG002 - as all do
    ) -> _PeerModel:
        """Return what asks the program; it learns when it is asked."""
        return _PeerModel(self, evidence)

    def ask(self, evidence: DoorEvidence, times_ns: Times, known_ns: Times) -> Probabilities:
        """Return P(open) of one door at some times, by the program.

        Raises:
            EstimatorError: It ended, said that it cannot, or its answer is none.
        """
        room, door_id = Path(self._room.name), int(evidence.door_id)
        ask, answer = room / f"{door_id}.npz", room / f"{door_id}.npy"
        answer.unlink(missing_ok=True)
        told = evidence.up_to(int(known_ns.max()))
        columns: dict[str, Any] = {name: getattr(told, name) for name in EVIDENCE}
        np.savez(ask, times_ns=times_ns, known_ns=known_ns, **columns)
        self._exchange({"door": door_id, "ask": str(ask), "answer": str(answer)})
        if not answer.exists():
            raise EstimatorError(f"peer {self.name}: door {door_id}: wrote no answer.")
        p_open = np.load(answer)
        good = p_open.shape == times_ns.shape and bool(((p_open >= 0) & (p_open <= 1)).all())
        if not good:
            raise EstimatorError(
                f"peer {self.name}: door {door_id}: expected {len(times_ns)} numbers in 0..1, got "
                f"shape {p_open.shape}, {np.min(p_open, initial=1)}..{np.max(p_open, initial=0)}."
            )
        return np.asarray(p_open, np.float64)

    def _exchange(self, question: Mapping[str, Any]) -> None:
        assert self._process is not None, "asked outside of its `with` block"
        try:
            print(json.dumps(question), file=self._pipe(self._process.stdin), flush=True)
            line = self._pipe(self._process.stdout).readline()
        except BrokenPipeError:
            line = ""
        if not line:
            raise EstimatorError(
                f"peer {self.name}: ended with code {self._process.wait()} when it was asked about "
                f"door {question['door']}; its last words are above."
            )
        try:
            said = json.loads(line)
        except ValueError:
            said = {"error": f"expected a JSON line, got {line.strip()!r}"}
        if said != {"door": question["door"]}:
            raise EstimatorError(
                f"peer {self.name}: door {question['door']}: {said.get('error', said)}."
            )

    @staticmethod
    def _pipe(pipe: IO[str] | None) -> IO[str]:
        assert pipe is not None, "both are pipes"
        return pipe


class _PeerModel:
    """What a peer says about the doors of some evidence."""

    def __init__(self, peer: Peer, evidence: Mapping[DoorId, DoorEvidence]) -> None:
        self._peer = peer
        self._evidence = evidence

    def predict(self, door_id: DoorId, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""
        if door_id not in self._evidence or not len(times_ns):
            return Forecast.of_nothing(len(times_ns))
        p_open = self._peer.ask(self._evidence[door_id], times_ns, known_ns)
        return Forecast.of(p_open, p_open, p_open, np.ones(len(p_open), np.bool_))
