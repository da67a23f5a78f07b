"""A log that a robot has signed and an officer has trimmed: by age, by repetition, by person."""

from __future__ import annotations

import random
import shutil
from dataclasses import dataclass
from pathlib import Path

import semmap_log as sl
from fault_injection.sample import small_segments
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved, Event, RobotPose
from semmap_log.log.signing.background_signer import BackgroundSigner
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import make_key, sign
from semmap_log.log.signing.statement import HEADS, TRIMMING, PublicKey
from semmap_log.log.trimming.redaction import Notes, Redaction, Tracks
from semmap_log.log.trimming.repeated_sightings import Thinning
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.reading.reader import LogReader

MINUTE_NS = 60 * 10**9
COMMITS_A_SEGMENT = 12
ZONE = "Europe/Berlin"


class MinuteClock:
    """A clock that ticks ten minutes at each look."""

    boot_id = bytes(16)

    def __init__(self, now_ns: int = 1_700_000_000 * 10**9) -> None:
        self.now_ns = now_ns

    def wall_ns(self) -> int:
        self.now_ns += 10 * MINUTE_NS
        return self.now_ns

    def monotonic_ns(self) -> int:
        return self.now_ns


@dataclass(frozen=True)
class SignedSample:
    """Signed logs of one robot, and the keys."""

    log: Path
    """Signed to its end; each kind of trimming was vouched for by the officer."""
    stages: tuple[Path, ...]
    """The same log at earlier times, each good then: untrimmed, redacted, expired, thinned."""
    other: Path
    """Another log of the same robot."""
    keys: Path
    """The folder of the keys, with their states."""
    robot: SigningKey
    officer: SigningKey
    stranger: SigningKey

    @property
    def trusted(self) -> dict[bytes, PublicKey]:
        """Whom to believe, and for what."""
        believed = ((self.robot, "robot", HEADS), (self.officer, "officer", TRIMMING))
        return {
            key.public_bytes: PublicKey(key.public_bytes, name, frozenset({namespace}))
            for key, name, namespace in believed
        }


def make_signed(folder: Path) -> SignedSample:
    """Write the logs into that folder."""
    keys, log, clock = folder / "keys", folder / "log", MinuteClock()
    keys.mkdir()
    robot, officer, stranger = (
        make_key(keys / name, log=log) for name in ("robot", "officer", "stranger")
    )
    stages: list[Path] = []

    def keep() -> None:
        stages.append(Path(shutil.copytree(log, folder / f"stage{len(stages)}")))

    def trim(rule: TrimRule) -> None:
        done = trim_log(log, rule, writing={"clock": clock, "compact": False})
        assert done.event is not None, "something of that is there"
        sign(log, officer, trimmed=True)
        sign(log, robot)
        keep()

    with small_segments(COMMITS_A_SEGMENT):
        _record(log, robot, clock, 40, is_new=True)
        keep()
        trim(Redaction.of(LogReader(log), [Tracks(), Notes("anna")], 60))
        _record(log, robot, clock, 30)
        trim(Retention(LogReader(log), clock.now_ns - 50 * 10 * MINUTE_NS))
        _record(log, robot, clock, 10)
        trim(Thinning(LogReader(log), clock.now_ns - 5 * 10 * MINUTE_NS))
        _record(log, robot, clock, 14)
        _record(folder / "other", robot, clock, 5, is_new=True)
    return SignedSample(log, tuple(stages), folder / "other", keys, robot, officer, stranger)


def _record(
    path: Path, key: SigningKey, clock: MinuteClock, commits: int, *, is_new: bool = False
) -> None:
    """Record sightings that repeat, poses, notes, and commands with ids of their own."""
    draw = random.Random(commits)
    signer = BackgroundSigner(path, key, every_s=3600)
    about = {"clock": clock, "entropy": draw.randbytes, "compact": False, "signer": signer}
    with signer, (
        sl.create(path, tz=ZONE, building="clinic", robot="tug1", **about)  # type: ignore[arg-type]
        if is_new
        else sl.append(path, **about)  # type: ignore[arg-type]
    ) as log:  # fmt: skip
        if is_new:
            for name in ("front", "back"):
                log.add_door(x=1.0, y=2.0, theta=0.1, width=0.9, name=name, actor="anna")
        for number in range(commits):
            append_some(log, draw, number)
    assert signer.is_all_signed, signer.problem


def append_some(log: sl.DoorLogWriter, draw: random.Random, number: int) -> None:
    """Append a commit of what a robot sees on its way."""
    state = DoorState.OPEN if number % 10 < 5 else DoorState.CLOSED
    seen: list[Event] = [
        DoorObserved(door_id=DoorId(1 + number % 2), state=state, accuracy_open=0.9)
        for _ in range(1 + number % 5)
    ]
    if number % 3 == 0:
        seen.insert(0, RobotPose(level=0, x=draw.random(), y=2.0, theta=0.0))
    note = {"actor": "anna" if number % 4 == 0 else "bert"} if number % 2 == 0 else {}
    command_id = draw.randbytes(16) if number % 5 == 0 else None
    log.append(seen, note=sl.Note(**note), command_id=command_id)
