"""Hostile files given to whatever reads files: bounded memory, bounded work, plain errors."""

from __future__ import annotations

import os
import random
import resource
import shutil
import sys
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path

import semmap_log as sl
from fault_injection.acknowledged import Tell
from fault_injection.fault import Outcome, Plan
from fault_injection.forking import forked
from fault_injection.hostile.bags import bag_bomb, bag_liar, mcap_bomb, mcap_liar, mcap_of_many
from fault_injection.hostile.logs import hostile_log
from fault_injection.hostile.texts import csv_bomb, gzip_bomb, json_bomb, picture_bomb, yaml_bomb
from fault_injection.pool import side_by_side
from fault_injection.subject import keep
from fault_injection.verbs import Answer, ask_verb, heard_answers, tell_answers

USUAL = 150
MOST_MIB = 600
"""So much more memory than before a verb may take, whatever the file says."""
ROOM_MIB = 4096
"""Address space beyond what there is: more is refused by the kernel."""
LONGEST_S = 10
"""Of work, in seconds of a processor."""

Make = Callable[[Path, random.Random], str]
Ask = tuple[str, ...]
LOG, FILE = "{log}", "{file}"

FOREIGN: tuple[tuple[str, Make, tuple[Ask, ...]], ...] = (
    ("made.mcap", mcap_bomb, (("import", LOG, FILE), ("info", FILE), ("verify", FILE))),
    ("made.mcap", mcap_of_many, (("import", LOG, FILE), ("info", FILE))),
    ("made.mcap", mcap_liar, (("import", LOG, FILE), ("info", FILE), ("verify", FILE))),
    ("made.bag", bag_bomb, (("import", LOG, FILE), ("info", FILE))),
    ("made.bag", bag_liar, (("import", LOG, FILE), ("info", FILE))),
    ("made.yaml", yaml_bomb, (("import", LOG, FILE), ("import", LOG, "{bag}", "--mapping", FILE),
                              ("costmap", LOG, "{out}/made.png", "--map", FILE))),
    ("made.building.yaml", yaml_bomb, (("import", LOG, FILE),)),
    ("made.jsonl", json_bomb, (("import", LOG, FILE), ("record", LOG))),
    ("made.jsonl.gz", gzip_bomb, (("import", LOG, FILE),)),
    ("made.csv.gz", gzip_bomb, (("import", LOG, FILE),)),
    ("made.csv", csv_bomb, (("import", LOG, FILE), ("import", LOG, FILE, "--windows", FILE))),
    ("made.map.yaml", picture_bomb, (("costmap", LOG, "{out}/made.png", "--map", FILE),)),
)  # fmt: skip
OWN: tuple[Ask, ...] = (
    ("verify", FILE), ("info", FILE), ("replay", FILE, "--json"), ("history", FILE, "--json"),
    ("tail", FILE), ("replay", FILE, "--known-at", "now"), ("recover", FILE),
    ("observe", FILE, "1", "open"), ("compact", FILE),
)  # fmt: skip


def bombs(plan: Plan) -> Generator[Outcome, None, None]:
    """Give hostile files to the verbs that read files, on all cores."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    folder = plan.folder / f"bombs-{share}"
    folder.mkdir()
    with sl.create(folder / "log", tz="UTC") as log:
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front")
    _import_what_verbs_import(folder)
    for turn in plan.turns(USUAL, share, shares):
        yield _try_one(plan, turn, folder)


def _import_what_verbs_import(folder: Path) -> None:
    """Ask good files once, so that each child finds all modules there."""
    dice = random.Random(1)
    file = folder / "good.mcap"
    mcap_liar(file, dice)
    log = folder / "asked"
    shutil.copytree(folder / "log", log)
    for ask in (("import", str(log), str(file)), ("verify", str(log)), ("info", str(log))):
        ask_verb(ask, log, folder / "out")


def _try_one(plan: Plan, turn: int, folder: Path) -> Outcome:
    """Do what the seed and the turn alone decide."""
    dice = random.Random(f"{plan.seed} {turn}")
    room = folder / "room"
    shutil.rmtree(room, ignore_errors=True)
    room.mkdir()
    if dice.random() < 0.35:
        file = room / "stranger"
        ask, make = dice.choice(OWN), hostile_log
    else:
        name, make, asks = dice.choice(FOREIGN)
        file, ask = room / name, dice.choice(asks)
    what = f"{turn}: {ask[0]}: {make(file, dice)}"
    log = room / "log"
    shutil.copytree(folder / "log", log)
    stands_for = {LOG: str(log), FILE: str(file), "{bag}": str(log), "{out}": str(room / "out")}
    arguments = tuple(_replaced(part, stands_for) for part in ask)
    ended = forked(partial(_limited, arguments, file, room))
    problem = _problem(heard_answers(ended).get(ask[0]), str(file), ask)
    if not problem:
        return Outcome(what, 1)
    kept = keep(room, plan.keep, what[:80])
    return Outcome(what, 1, problem=problem, kept=kept)


def _replaced(part: str, stands_for: dict[str, str]) -> str:
    for name, value in stands_for.items():
        part = part.replace(name, value)
    return part


def _limited(arguments: Ask, file: Path, room: Path, tell: Tell) -> None:
    """Run a verb with little room and time; for a child process."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    most = size + ROOM_MIB * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(used.ru_utime + used.ru_stime) + LONGEST_S
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    if arguments[0] == "record":
        os.dup2(os.open(file, os.O_RDONLY), 0)
        sys.stdin = os.fdopen(0, encoding="utf-8", errors="surrogateescape")
    before = _resident_mib()

    def ask() -> Answer:
        answer = ask_verb(arguments, room / "log", room / "out")
        more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024 - before
        return Answer(answer.code, str(more), answer.error)

    tell_answers({arguments[0]: ask}, tell)


def _resident_mib() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 2**20


_NOT_WORDS = ("Traceback", "AssertionError", "MemoryError", "RecursionError", "struct.error")


def _problem(answer: Answer | None, file: str, ask: Ask) -> str:
    """Say what is wrong with the way a verb ended; empty: nothing."""
    if answer is None:
        return "never asked"
    if answer.code < 0:
        return answer.error.strip()[-700:]
    if int(answer.said) > MOST_MIB:
        return f"{answer.said} MiB of memory were taken"
    for word in _NOT_WORDS:
        if word in answer.error:
            return f"exit {answer.code}, and a message with {word}: {answer.error.strip()[-400:]}"
    names = ("line ",) if ask[0] == "record" else (file, Path(file).name)
    tells = {"verify", "recover"} & set(ask)  # which name files on stdout
    if answer.code and not any(name in answer.error for name in names) and not tells:
        return f"exit {answer.code}, and no file is named: {answer.error.strip()[-400:]!r}"
    return ""
