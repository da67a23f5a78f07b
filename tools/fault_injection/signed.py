"""Signed logs attacked without their keys: each finding has its exit code, wherever it is done."""

from __future__ import annotations

import random
import shutil
import warnings
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fault_injection.fault import Outcome, Plan
from fault_injection.judging import keep
from fault_injection.pool import side_by_side
from fault_injection.signed_logs.attacks import ATTACKS, Attack, Scene
from fault_injection.signed_logs.sample import SignedSample, make_signed
from semmap_log.errors import SigningError
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.signing.log_signing import sign
from semmap_log.log.signing.signed_log import verify_signed
from semmap_log.store.verification.findings import EXIT_DAMAGE

USUAL = 4 * len(ATTACKS)


def signed(plan: Plan) -> Generator[Outcome, None, None]:
    """Do each attack of the list again and again, at random places, on all cores."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    folder = plan.folder / f"signed-{share}"
    folder.mkdir()
    sample = make_signed(folder)
    for turn in plan.turns(USUAL, share, shares):
        one = ATTACKS[turn % len(ATTACKS)]
        what = f"{turn}: {one.name}"
        with scene_of(sample, folder / "room", random.Random(f"{plan.seed} {turn}")) as scene:
            problem = try_attack(one, scene)
            kept = keep(scene.log, plan.keep, what) if problem else None
        yield Outcome(what, 1, 0, 0, problem, kept)


@contextmanager
def scene_of(sample: SignedSample, room: Path, dice: random.Random) -> Iterator[Scene]:
    """Hand out a copy of a signed log; afterwards the keys know again what they knew."""
    states = {file: file.read_bytes() for file in sample.keys.glob("*.state")}
    room.mkdir()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield Scene(sample, Path(shutil.copytree(sample.log, room / "log")), dice)
    finally:
        shutil.rmtree(room)
        for file in sample.keys.glob("*.state"):
            file.unlink()
        for file, data in states.items():
            file.write_bytes(data)


def try_attack(one: Attack, scene: Scene) -> str:
    """Do an attack; return what `verify` should have said and has not; empty: it has."""
    one.do(scene)
    trusted = scene.sample.trusted
    found = verify_signed(scene.log, trusted, elsewhere=scene.elsewhere).found
    kinds = {finding.kind for finding in found.findings if finding.severity}
    plain = verify(scene.log).exit_code
    if found.exit_code != one.code or not kinds & one.kinds:
        return f"expected {one.code}, {one.kinds}; got {found.exit_code}, {kinds}"
    if (plain == 0) != one.fits:
        return f"without a key: {'expected 0' if one.fits else 'expected a finding'}, got {plain}"
    with suppress(SigningError):  # a robot that goes on and signs does not make it good
        sign(scene.log, scene.sample.robot)
    again = verify_signed(scene.log, trusted, elsewhere=scene.elsewhere).found.exit_code
    if one.code == EXIT_DAMAGE and again != EXIT_DAMAGE and not one.is_no_more:
        return f"once the robot has signed it: expected {EXIT_DAMAGE}, got {again}"
    return ""
