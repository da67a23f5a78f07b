"""What a verb takes for a small hostile log, or question about one, against a harmless twin."""

from __future__ import annotations

import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import warnings
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from fault_injection.fault import Outcome, Plan
from fault_injection.hostile.logs import costly_log, good_log, hostile_log
from fault_injection.judging import keep
from fault_injection.pool import side_by_side
from fault_injection.questions import TRACEBACK, Answer, ask_verb

ROOM_MIB = 1024
"""Address space beyond what there is: more is refused by the kernel."""
LONGEST_S = 12
"""Of work, in seconds of a processor; what takes longer is ended."""
DEADLINE_S = 120
"""So long may pass until then, on a machine that has other work, too: what hangs is ended."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What a child process did, and took for it."""

    answer: Answer
    cpu_s: float
    mib: int
    """So much more memory it had at once than when it began."""


def measured(arguments: tuple[str, ...], room: Path) -> Measured:
    """Run a verb in a child process, with little room and time.

    Args:
        arguments: Of the command line.
        room: A folder for what it writes.
    """
    told, begun = room / "told.json", room / "begun"
    told.unlink(missing_ok=True)
    pid = os.fork()
    if pid == 0:
        _run(arguments, room, told)
    _, status, used = os.wait4(pid, 0)
    code = os.waitstatus_to_exitcode(status)
    answer = Answer(TRACEBACK, "", f"ended by {_end(code)}")
    if told.exists():
        answer = Answer(*json.loads(told.read_text()))
    at_first = int(begun.read_text())
    return Measured(answer, used.ru_utime + used.ru_stime, used.ru_maxrss // 1024 - at_first)


def _end(code: int) -> str:
    return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


def _run(arguments: tuple[str, ...], room: Path, told: Path) -> NoReturn:
    """For the child: it never returns."""
    code = 3
    try:
        (room / "begun").write_text(str(_mib(1)))
        _limit()
        answer = ask_verb(arguments, room, room / "out", last=10_000)
        partial = told.with_suffix(".part")
        partial.write_text(json.dumps([answer.code, answer.said, answer.error]))
        partial.rename(told)
        code = 0
    finally:
        os._exit(code)


def _mib(place: int) -> int:
    """Return how much memory this process has: 0: addresses, 1: what is there."""
    pages = int(Path("/proc/self/statm").read_text().split()[place])
    return pages * os.sysconf("SC_PAGE_SIZE") // 2**20


def _limit() -> None:
    most = (_mib(0) + ROOM_MIB) * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S + 2))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(DEADLINE_S)


def load_what_it_loads(arguments: tuple[str, ...], room: Path) -> None:
    """Run a verb in a child process, and import here what it imported: it costs others nothing.

    Args:
        arguments: Of the command line.
        room: A folder for what it writes.
    """
    names = room / "names"
    pid = os.fork()
    if pid == 0:
        with suppress(BaseException):
            before = set(sys.modules)
            ask_verb(arguments, room, room / "out")
            names.write_text("\n".join(name for name in sys.modules if name not in before))
        os._exit(0)
    os.waitpid(pid, 0)
    for name in names.read_text().splitlines() if names.exists() else ():
        with suppress(Exception):
            import_module(name)
    names.unlink(missing_ok=True)


USUAL = 500
MORE_MIB = 100
"""So much more memory than for its harmless twin may a verb take for a small input."""
MORE_S, LOG_MORE_S = 2.0, 3.0
"""So many more seconds of a processor; the second for what is asked about a log of ours."""
OFFICE = Path(__file__).parents[2] / "recordings" / "office"
"""The harmless twin of a log: events of a day."""

Ask = tuple[str, ...]
LOG, FILE = "{log}", "{file}"
MOMENTS = ("@0", "@1", "1970-01-02", "2026-03-02T12:00", "2027-01-01", "2200-01-01", "2261-01-01")

VERBS: tuple[Ask, ...] = (
    ("info", LOG), ("info", LOG, "--all-doors"), ("verify", LOG), ("replay", LOG), ("tail", LOG),
    ("replay", LOG, "--json"), ("history", LOG), ("history", LOG, "--json"), ("show", LOG, "20"),
    ("history", LOG, "1"), ("history", LOG, "--plot", "{out}/made.png"), ("timeline", LOG, "1"),
    ("timeline", LOG, "1", "--json"), ("diff", LOG, "event:20", "event:200"), ("rooms", LOG),
    ("why", LOG, "1"), ("why", LOG, "1", "--at", "2026-03-02T12:00"),
    ("rooms", LOG, "--plot", "{out}/made.png"), ("rooms", LOG, "--out", "{out}/made.geojson"),
    ("probabilities", LOG), ("probabilities", LOG, "--by", "week"), ("best-time", LOG, "1"),
    ("probabilities", LOG, "1", "--plot", "{out}/made.png"),
    *(("probabilities", LOG, "--estimator", name) for name in ("schedule", "count", "fremen5")),
    ("probabilities", LOG, "--as-happened"), ("best-time", LOG, "1", "--as-happened"),
    ("patrol-plan", LOG), ("patrol-plan", LOG, "--plot", "{out}/made.png"),
    ("go", LOG, "hall", "hardware room"), ("evaluate", LOG, "--step", "600"),
    ("evaluate", LOG, "--prequential", "--step", "600"),
    ("costmap", LOG, "{out}/made.png"), ("costmap", LOG, "{out}/made.npy"),
    ("costmap", LOG, "{out}/made.npy", "--layer", "door", "--resolution", "0.1"),
    ("costmap", LOG, "{out}/made.mcap"), ("report", LOG, "{out}/made.html"),
    *(("export", LOG, f"{{out}}/made.{name}")
      for name in ("geojson", "csv", "jsonl", "parquet", "mcap", "bag", "pgm", "html", "rrd")),
    ("export", LOG, "{out}/made.yaml", "--default-prob", "0.5"),
    ("export", LOG, "{out}/made.jsonl", "--pseudonymous"), ("compact", LOG), ("index", LOG),
    ("sql", LOG, "select * from intervals"), ("sql", LOG, "select * from beliefs('@1772438400')"),
    ("sql", LOG, "select count(*), min(happened) from events"), ("recover", LOG),
    ("copy", LOG, "{out}/copy"), ("retain", LOG, "--thin", "2026-03-02", "--dry-run"),
    ("retain", LOG, "--keep", "2026-03-02", "--dry-run"), ("redact", LOG, "--notes", "--dry-run"),
)  # fmt: skip
"""Every verb that answers something about a log."""

QUESTIONS: dict[str, tuple[Ask, ...]] = {
    "--at": tuple((one,) for one in MOMENTS), "--known-at": tuple((one,) for one in MOMENTS),
    "--since": tuple((one,) for one in MOMENTS), "--until": tuple((one,) for one in MOMENTS),
    "--day": tuple((one,) for one in MOMENTS), "--start": tuple((one,) for one in MOMENTS),
    "--depart": tuple((one,) for one in MOMENTS), "--near": (("100000d",), ("1s",)),
    "--horizon": (("100000d",), ("1s",)), "-n": (("168",), ("1000000000",)),
    "--step": (("1e-6",), ("0.001",), ("1e9",)), "--patrol": (("1s",), ("100000d",)),
    "--resolution": (("1e-6",), ("1e-300",), ("1e9",)), "--inflate": (("1e9",), ("1e3",)),
    "--door-inflate": (("1e9",),), "--scaling": (("1e-300",), ("1e300",)),
    "--every": (("1e-9",), ("1e9",)), "--budget": (("100000d",), ("1s",)),
    "--speed": (("1e-300",), ("1e300",)), "--patience": (("100000d",),),
    "--wait": (("100000d",),), "--tz": (("Africa/Monrovia",), ("Pacific/Apia",)),
}  # fmt: skip
"""Option -> what may be asked with it; verbs that lack it say so, at once."""

STRANGERS: tuple[Ask, ...] = (
    ("verify", FILE), ("info", FILE), ("replay", FILE, "--json"), ("history", FILE, "--json"),
    ("tail", FILE), ("replay", FILE, "--known-at", "now"), ("recover", FILE),
    ("observe", FILE, "1", "open"), ("compact", FILE),
)  # fmt: skip
"""The verbs that are given a stranger's log.

Files of others, lines for servers, and stores are bounded in `tests/interop/formats`,
`tests/live` and `tests/fleet`.
"""


def costs(plan: Plan) -> Generator[Outcome, None, None]:
    """Give small hostile inputs to every verb that answers, on all cores."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    warnings.simplefilter("ignore")
    bench = Bench(plan, plan.folder / f"costs-{share}")
    for turn in plan.turns(USUAL, share, shares):
        yield bench.try_one(turn)


class Bench:
    """Where one process measures."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        folder.mkdir()
        self._plan = plan
        self._room = folder / "room"
        self._twins: dict[Ask, Measured] = {}
        """Command line -> what it takes for what is harmless."""

    def try_one(self, turn: int) -> Outcome:
        """Do what the seed and the turn alone decide."""
        dice = random.Random(f"{self._plan.seed} {turn}")
        ways = (self._costly, self._question, self._stranger)
        what, problem = dice.choices(ways, (10, 4, 7))[0](dice)
        kept = keep(self._room, self._plan.keep, f"{turn}: {what[:80]}") if problem else None
        return Outcome(f"{turn}: {what}", 1, problem=problem, kept=kept)

    def _fresh(self) -> Path:
        """Return a copy of an ordinary log, in an empty room."""
        shutil.rmtree(self._room, ignore_errors=True)
        shutil.copytree(OFFICE, self._room / "log")
        return self._room / "log"

    def _placed(self, ask: Ask, file: Path = OFFICE) -> Ask:
        log = f"{self._room}/log"
        names = {LOG: log, FILE: str(file), "{out}": f"{self._room}/out"}
        return tuple(re.sub(r"\{\w+\}", lambda found: names[found[0]], part) for part in ask)

    def _twin(self, ask: Ask) -> Measured:
        """Return what a verb takes for an ordinary log, or for a harmless one of a stranger."""
        if ask not in self._twins:
            for look in (load_what_it_loads, measured):
                self._fresh()
                file = self._room / "stranger"
                good_log(file)
                found = look(self._placed(ask, file), self._room)
            assert found is not None
            self._twins[ask] = found
        return self._twins[ask]

    def _costly(self, dice: random.Random) -> tuple[str, str]:
        """Ask a verb about a log that tempts into work."""
        ask = dice.choice(VERBS)
        twin = self._twin(ask)
        made = costly_log(self._fresh(), dice)
        found = measured(self._placed(ask), self._room)
        return f"{' '.join(ask)}: {made}", too_much(found, twin, LOG_MORE_S)

    def _question(self, dice: random.Random) -> tuple[str, str]:
        """Ask a verb about an ordinary log, or a costly one, with a bound that is far away."""
        ask = dice.choice(VERBS)
        twin = self._twin(ask)
        log = self._fresh()
        made = costly_log(log, dice) if dice.random() < 0.3 else "an ordinary log"
        options = dice.sample(list(QUESTIONS), dice.choice((1, 1, 2)))
        ask = (*ask, *(part for name in options for part in (name, *dice.choice(QUESTIONS[name]))))
        found = measured(self._placed(ask), self._room)
        return f"{' '.join(ask)}: {made}", too_much(found, twin, LOG_MORE_S)

    def _stranger(self, dice: random.Random) -> tuple[str, str]:
        """Give a verb a stranger's log."""
        ask = dice.choice(STRANGERS)
        twin = self._twin(ask)
        log, file = self._fresh(), self._room / "stranger"
        what = f"{' '.join(ask)}: {hostile_log(file, dice)}"
        found = measured(self._placed(ask, file), self._room)
        names = (str(file), file.name, str(log))
        return what, too_much(found, twin, MORE_S) or _unfit(found, names)


def too_much(found: Measured, twin: Measured, more_s: float) -> str:
    """Say what a verb took too much of; empty: nothing, and it ended as a verb may."""
    ended = f"exit {found.answer.code} {found.answer.error.strip()[-100:]!r}"
    if found.mib - twin.mib > MORE_MIB:
        return f"{found.mib} MiB more than at its start, its twin {twin.mib} MiB; {ended}"
    if found.cpu_s - twin.cpu_s > more_s:
        return f"{found.cpu_s:.1f} s of a processor, its twin {twin.cpu_s:.1f} s; {ended}"
    if found.answer.code < 0 or _NOT_WORDS.search(found.answer.error):
        return f"exit {found.answer.code}: {found.answer.error.strip()[-700:]}"
    return ""


_NOT_WORDS = re.compile("Traceback|AssertionError|MemoryError|RecursionError|struct.error")


def _unfit(found: Measured, names: tuple[str, ...]) -> str:
    """Say what is wrong with the words by which a file was refused; empty: nothing."""
    code, error = found.answer.code, found.answer.error.strip()
    if code == 0:
        return ""
    said = error + found.answer.said  # `verify` and `recover` name files on stdout
    if not any(name in said for name in names):
        return f"exit {code}, and nothing is named: {error[-400:]!r}"
    lines = [line for line in error.splitlines() if line.startswith("semmap-log:")]
    if code == 1 and (len(lines) > 4 or len(error) > 4000):
        return f"exit {code}, in {len(lines)} lines, {len(error)} letters: {error[:300]!r}"
    return ""
