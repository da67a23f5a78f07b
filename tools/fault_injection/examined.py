"""A damaged log examined by everybody: verbs, readers that were there before, a writer, the oracle.

One child process for each damage: it opens readers, does the damage, asks, and goes on writing.
"""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import semmap_log as sl
from fault_injection.forking import forked
from fault_injection.oracle_client import Oracle, disagreements
from fault_injection.questions import (
    LOG,
    OUT,
    TRACEBACK,
    Answer,
    Arguments,
    ask_verb,
    heard_answers,
    questions,
    tell_answers,
    what_is_wrong,
)
from fault_injection.questions import answer as answered
from semmap_log.errors import SemmapError

ALWAYS = ("replay", "history", "tail -n 5", "info", "verify")
SOME = 12
"""Of the other questions, so many at each damage, in turns."""
WHO = ("held", "before", "anew")
"""A reader from before the damage, as it is; one that refreshes; and one that is opened then."""
WRITERS = ("observe", "compact", "record")
Damage = Callable[[Path], object]


class Place(Protocol):
    """A place where logs are damaged that needs care before and after."""

    def make_anew(self) -> None:
        """Make it, empty."""

    def settle(self, log: Path) -> None:
        """See to it that a copy that was just made is as one that has lain there for long."""


@dataclass
class Findings:
    """What is wrong with the answers of a damaged log."""

    lost: int = 0
    problems: list[str] = field(default_factory=list)

    def add(self, name: str, problem: str) -> None:
        """Take in what is wrong with one answer."""
        if problem:
            self.problems.append(f"{name}: {problem}")


class Examined:
    """A log that is not damaged, and what everybody says of it."""

    def __init__(
        self, log: Path, folder: Path, oracle: Oracle, *, damaged: Path | None = None
    ) -> None:
        """Ask everything of it.

        Args:
            log: Not damaged; it is copied.
            folder: Where copies are made.
            oracle: Says what is in it.
            damaged: Where the copy to damage is made; default: in that folder, too.
        """
        self._folder = folder
        self._oracle = oracle
        self.whole = folder / "whole" / log.name
        self.copy = (damaged or folder / "damaged") / log.name
        shutil.copytree(log, self.whole, ignore=shutil.ignore_patterns(".lock"))
        self.found = oracle.ask(self.whole)
        assert not self.found["problems"], self.found["problems"]
        self.verbs = dict(_verbs(self.found))
        self._asked = self._questions()
        self._shorter: dict[int, dict[str, Answer]] = {}
        for arguments in self.verbs.values():  # here, so that children have all that is imported
            ask_verb(arguments, self.whole, folder / "out")
        self.truth = self._answers_of_whole()

    @property
    def commits(self) -> int:
        """How many it has."""
        return len(self.found["commits"])

    def try_damage(
        self,
        damage: Damage,
        turn: int,
        *,
        may_lose: int = 0,
        place: Place | None = None,
        writer: str | None = None,
    ) -> Findings:
        """Damage a copy, and ask it.

        Args:
            damage: Changes the files of a folder.
            turn: Chooses among the questions that are not asked each time.
            may_lose: How many commits at the end may be missing, as a crash leaves them.
            place: Where the copy is made, if that needs care.
            writer: What changes the log in the end; empty: nothing; default: one of several.
        """
        if place is not None:
            place.make_anew()
        self._fresh_copy()
        if place is not None:
            place.settle(self.copy)
        writer = WRITERS[turn % len(WRITERS)] if writer is None else writer
        names = self._names(turn)
        ended = forked(partial(self._ask_damaged, damage, names, writer, reads=place is None))
        answers = heard_answers(ended)
        findings = Findings()
        if ended.status == 3 and not answers:
            raise RuntimeError(f"the trying itself failed: {ended.error}")
        self._judge(answers, findings, may_lose)
        self._judge_writer(writer, answers, findings, may_lose)
        return findings

    def _fresh_copy(self) -> None:
        shutil.rmtree(self.copy, ignore_errors=True)
        shutil.copytree(self.whole, self.copy)

    def _names(self, turn: int) -> list[str]:
        """Return the questions of one damage; the order of the others is the same each time."""
        others = [name for name in (*self.verbs, *self._asked) if name not in ALWAYS]
        random.Random("order").shuffle(others)
        start = turn * SOME % len(others)
        return [*ALWAYS, *(others + others)[start : start + SOME]]

    def _answers_of_whole(self) -> dict[str, Answer]:
        self._fresh_copy()
        names = [*self.verbs, *self._asked]
        ended = forked(partial(self._ask_damaged, lambda _: None, names, ""))
        answers = heard_answers(ended)
        bad = {name: one for name, one in answers.items() if one.code < 0}
        assert set(names) == set(answers), f"unanswered: {ended.error}"
        assert not bad, f"a whole log is not answered: {bad}"
        wrong = disagreements(self._oracle, self.whole, self.verbs, answers)
        assert not wrong, f"verbs and the oracle do not agree on a whole log: {wrong}"
        return answers

    def _without_last(self, commits: int) -> dict[str, Answer]:
        """Return what is said of the log without its last commits, as a crash may leave it."""
        if commits not in self._shorter:
            self._fresh_copy()
            _take_off(self.copy, commits)
            names = [*self.verbs, *self._asked]
            ended = forked(partial(self._ask_damaged, lambda _: None, names, ""))
            self._shorter[commits] = heard_answers(ended)
        return self._shorter[commits]

    def _questions(self) -> dict[str, Any]:
        commits = self.found["commits"]
        moments = [commit["recorded"] for commit in commits[:: max(1, len(commits) // 4)]]
        numbers = [commit["first_event"] for commit in commits][:: max(1, len(commits) // 6)]
        asked = questions(moments, numbers)
        half = numbers[len(numbers) // 2]
        asked["follow"] = lambda log: [
            (f.commit.hash, [r.number for r in f]) for f in log.follow(half, stop=lambda: True)
        ]
        return {f"{who}: {name}": ask for name, ask in asked.items() for who in WHO}

    def _ask_damaged(
        self,
        damage: Damage,
        names: list[str],
        writer: str,
        tell: Callable[[str], object],
        *,
        reads: bool = True,
    ) -> None:
        """Open readers, do the damage, and ask; for a child process.

        Args:
            damage: Changes the files of a folder.
            names: Of the questions.
            writer: What changes the log in the end; empty: nothing.
            tell: Hears the answers.
            reads: Whether the readers read anything before: then the kernel has it in memory.
        """
        held, before = sl.read(self.copy), sl.read(self.copy)
        if reads:
            list(before.commits())
            before.replay()
        damage(self.copy)
        readers = {
            "held": lambda: held,
            "before": partial(_refreshed, before),
            "anew": partial(sl.read, self.copy),
        }
        out = self._folder / "out"
        asked: dict[str, Callable[[], Answer]] = {}
        for name in names:
            if name in self.verbs:
                asked[name] = partial(ask_verb, self.verbs[name], self.copy, out)
            else:
                reader = readers[name.partition(":")[0]]
                asked[name] = partial(_ask_reader, reader, self._asked[name])
        tell_answers(asked, tell)
        if writer:
            asked = {writer: partial(_write, writer, self.copy, out)}
            asked["verify afterwards"] = partial(
                ask_verb, ("verify", LOG, "--json"), self.copy, out
            )
            tell_answers(asked, tell)

    def _judge(self, answers: dict[str, Answer], findings: Findings, may_lose: int) -> None:
        files = [str(self.copy)]
        truths = [self.truth]
        if may_lose:
            truths += [self._without_last(may_lose)]
        lengths: dict[str, list[dict[str, Answer]]] = {}
        for name, answer in answers.items():
            if name not in self.truth or name == "verify":
                continue
            problem = what_is_wrong(answer, [truth[name] for truth in truths], files)
            findings.add(name, problem)
            if problem or not answer.is_good:
                continue
            who = name.partition(":")[0] if name in self._asked else "verbs"
            agree = lengths.get(who, truths)
            agree = [truth for truth in agree if truth[name].said == answer.said]
            if not agree:
                findings.add(name, "an answer of another length of the log than the one before")
            lengths[who] = agree or truths
        if answers.get("verify", Answer(1, "")).code < 0:
            findings.add("verify", answers["verify"].error)

    def _judge_writer(
        self, writer: str, answers: dict[str, Answer], findings: Findings, may_lose: int
    ) -> None:
        """What a writer accepts, it must not build on a loss; and `verify` must not hide one."""
        done = answers.get(writer)
        if done is None:
            return
        if done.code < 0 or writer == "recover":  # that makes another log
            findings.add(writer, done.error if done.code < 0 else "")
            return
        found = self._oracle.ask(self.copy)
        there = [commit["hash"] for commit in found["commits"]]
        wanted = [commit["hash"] for commit in self.found["commits"]]
        wanted = wanted[: len(wanted) - may_lose] if may_lose else wanted
        lost = sum(a != b for a, b in zip(wanted, there, strict=False))
        lost += max(0, len(wanted) - len(there))
        is_headless = bool(wanted) and wanted[-1] not in there
        if is_headless and done.code == 0 and writer != "compact":
            findings.lost += lost
            findings.add(writer, f"goes on, though {lost} commits are gone, the last ones of them")
        if lost and answers["verify afterwards"].code == 0:
            findings.lost = max(lost, findings.lost)
            findings.add("verify", f"says good behind {writer}; {lost} commits are gone")


def _take_off(log: Path, commits: int) -> None:
    """Cut the last commits off the live segment."""
    from fault_injection.judging import commit_places

    last = max(log.glob("*.mcap"))
    places = commit_places(last)
    if commits >= len(places):
        last.unlink()
        return
    data = last.read_bytes()[: places[-commits][0]]
    last.write_bytes(data)


def _refreshed(log: sl.DoorLog) -> sl.DoorLog:
    log.refresh()
    return log


def _ask_reader(opened: Callable[[], sl.DoorLog], ask: Callable[[sl.DoorLog], Any]) -> Answer:
    try:
        return Answer(0, repr(answered(ask, opened())))
    except SemmapError as error:
        return Answer(1, "", str(error))
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        return Answer(TRACEBACK, "", repr(error))


def _write(writer: str, log: Path, out: Path) -> Answer:
    """Do what changes the log: by a verb, or as a program that appends some."""
    if writer == "observe":
        return ask_verb(("observe", LOG, "1", "open", "--json"), log, out)
    if writer == "recover":
        return ask_verb(("recover", LOG, "--out", f"{OUT}/saved", "--yes"), log, out)
    if writer == "compact":
        return ask_verb(("compact", LOG, "--json"), log, out)
    try:
        with sl.append(log, compact=False) as opened:
            for _ in range(3):
                opened.observe(1, "closed")
    except SemmapError as error:
        return Answer(1, "", str(error))
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        return Answer(TRACEBACK, "", repr(error))
    return Answer(0, "")


def _verbs(found: dict[str, Any]) -> Iterator[tuple[str, Arguments]]:
    """Yield the command lines that are asked, by name: each segment is met by several."""
    numbers = sorted(
        {
            number
            for one in found["segments"]
            for number in (one["first_event"], (one["first_event"] + one["next_event"]) // 2)
        }
        | {found["events"][-1]["event"]}
    )
    times = [f"@{commit['recorded']}" for commit in found["commits"][2::4]]
    door = next(e["door_id"] for e in found["events"] if e["kind"] == "DoorAdded")
    for number in numbers:
        yield f"replay --event {number}", ("replay", LOG, "--event", str(number), "--json")
        yield f"replay --at event:{number}", ("replay", LOG, "--at", f"event:{number}", "--json")
        yield f"show {number}", ("show", LOG, str(number), "--json")
    for moment in times:
        for option in ("--at", "--known-at"):
            yield f"replay {option} {moment}", ("replay", LOG, option, moment, "--json")
    for one, other in pairwise(numbers):
        yield f"diff {one} {other}", ("diff", LOG, f"event:{one}", f"event:{other}", "--json")
    first, last = numbers[0], numbers[-1]
    yield f"diff {first} {last}", ("diff", LOG, f"event:{first}", f"event:{last}", "--json")
    for since in times[1::2]:
        yield f"history --since {since}", ("history", LOG, "--since", since, "--json")
    yield "replay", ("replay", LOG, "--json")
    yield "history", ("history", LOG, "--poses", "--json")
    yield "history DOOR", ("history", LOG, str(door), "--json")
    yield "history -n 3", ("history", LOG, "-n", "3", "--json")
    yield "timeline", ("timeline", LOG, str(door), "--json")
    yield "timeline --at", ("timeline", LOG, str(door), "--at", times[1], "--json")
    yield "tail -n 5", ("tail", LOG, "-n", "5", "--json")
    yield f"tail --after {numbers[2 % len(numbers)]}", (
        "tail", LOG, "--after", str(numbers[2 % len(numbers)]), "--json",
    )  # fmt: skip
    yield "info", ("info", LOG, "--json")
    yield "verify", ("verify", LOG, "--json")
    yield "probabilities", ("probabilities", LOG, "--json")
    yield "probabilities --at", ("probabilities", LOG, "--at", times[-1], "--json")
    yield "best-time", ("best-time", LOG, str(door), "--json")
    for ending in (".csv", ".jsonl"):
        yield f"export {ending}", ("export", LOG, f"{OUT}/made{ending}")
    yield "export .yaml", ("export", LOG, f"{OUT}/made.yaml", "--default-prob", "0.5")
    yield "export .csv --at", ("export", LOG, f"{OUT}/made.csv", "--at", times[1])
    yield "costmap", ("costmap", LOG, f"{OUT}/made.npy")
    yield "costmap --at", ("costmap", LOG, f"{OUT}/made.npy", "--event", str(numbers[-2]))
