"""Logs that are trimmed, written and asked in any order: never a wrong answer."""

from __future__ import annotations

import random
import re
import shutil
import traceback
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from fault_injection.fault import Outcome, Plan
from fault_injection.judging import keep
from fault_injection.pool import side_by_side
from fault_injection.story import small_limits
from fault_injection.trimming import caring, derived, sending
from fault_injection.trimming.examining import examine
from fault_injection.trimming.life import Clock, Life, WrongError

USUAL = 500

Act = tuple[str, str]
"""What is done, and the seed of what it draws."""

ACTS: dict[Callable[[Life, random.Random], None], int] = {
    examine: 6, sending.write: 8, sending.late: 4, sending.retract: 3, sending.resend: 3,
    sending.other: 1, sending.large: 1, sending.import_file: 1, caring.pin: 2, caring.thin: 4,
    caring.keep: 3, caring.redact: 3, caring.compact: 1, caring.index: 1, caring.copy: 2,
    caring.since_ever: 1, caring.ask_others: 1, derived.joined: 1, derived.pseudonymous: 1,
    derived.exported: 1, derived.recovered: 1,
}  # fmt: skip
"""What can be done, and how often it is."""
BY_NAME = {act.__name__: act for act in ACTS}


def trimmed(plan: Plan) -> Generator[Outcome, None, None]:
    """Trim logs among all else that is done to them, on all cores."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    warnings.simplefilter("ignore")
    folder = plan.folder / f"trimmed-{share}"
    folder.mkdir()
    for turn in plan.turns(USUAL, share, shares):
        yield _try_one(plan, turn, folder)


def _try_one(plan: Plan, turn: int, folder: Path) -> Outcome:
    """Do what the seed and the turn alone decide."""
    acts = drawn_acts(plan.seed, turn)
    what = f"{turn}: {' '.join(name for name, _ in acts)}"
    played = play(acts, folder / "room")
    if not played.problem:
        return Outcome(what, played.checked)
    if plan.only is not None:
        played = fewest_acts(played, folder / "room")
        what = f"{turn}: {' '.join(name for name, _ in played.acts)}"
    kept = keep(folder / "room", plan.keep, what[:80])
    return Outcome(what, played.checked, problem=played.text, kept=kept)


def drawn_acts(seed: int, turn: int) -> list[Act]:
    """Return what is done to the log of a turn."""
    dice = random.Random(f"{seed} {turn}")
    names = dice.choices(list(BY_NAME), list(ACTS.values()), k=dice.randint(6, 30))
    names += [examine.__name__] * 2
    return [(name, f"{seed} {turn} {place}") for place, name in enumerate(names)]


@dataclass(frozen=True)
class Played:
    """What became of a log."""

    acts: list[Act]
    """Those that were done."""
    checked: int
    """Answers that were right."""
    steps: list[str]
    """What was done, in words."""
    problem: str = ""
    """What is wrong; empty: nothing."""

    @property
    def text(self) -> str:
        """What was done, and what is wrong then."""
        return "\n".join([*self.steps, self.problem])

    @property
    def kind(self) -> str:
        """The first words of what is wrong, by which it is known again."""
        last = self.problem.strip().split("\n")[-1]
        return " ".join(re.sub(r"\{.*?\}|'.*?'|\S*\d\S*", "", last).split()[:8])


def play(acts: Sequence[Act], room: Path) -> Played:
    """Do it to a new log in an empty folder."""
    shutil.rmtree(room, ignore_errors=True)
    room.mkdir()
    clock, problem = Clock(), ""
    done: list[Act] = []
    life: Life | None = None
    with ExitStack() as stack:
        stack.enter_context(clock.installed())
        is_small = int(acts[0][1].split()[1]) % 4 > 0
        if is_small:
            stack.enter_context(small_limits())
        try:
            life = Life(room, clock, is_small=is_small)
            for name, seed in acts:
                done.append((name, seed))
                BY_NAME[name](life, random.Random(seed))
        except WrongError as error:
            problem = str(error)
        except Exception:  # noqa: BLE001 - whatever it is, it is the finding
            problem = traceback.format_exc()
    steps, checked = ([], 0) if life is None else (life.steps, life.checked)
    return Played(done, checked, steps, problem)


def fewest_acts(played: Played, room: Path) -> Played:
    """Leave out what is not needed for a problem of that kind: halves, quarters, single acts."""
    size = len(played.acts) // 2
    while size:
        end = len(played.acts)
        while end > 0:
            fewer = played.acts[: max(0, end - size)] + played.acts[end:]
            found = play(fewer, room) if fewer else None
            if found is not None and found.problem and found.kind == played.kind:
                played = found
            end = min(end - size, len(played.acts))
        size //= 2
    return play(played.acts, room)
