"""Files and sectors damaged, gone, exchanged, of another day, copy or log; and files of others.

Cut, zeroed, as they once were, of a copy that went on differently, renamed, linked, and more.
"""

from __future__ import annotations

import os
import random
import shutil
from collections.abc import Callable, Generator, Iterator
from functools import cache, partial
from pathlib import Path

from fault_injection.examined import Damage, Examined
from fault_injection.fault import Outcome, Plan
from fault_injection.judging import commit_places, keep
from fault_injection.oracle_client import Oracle
from fault_injection.pool import side_by_side
from fault_injection.sample import Chain, make_chains
from semmap_log.store.record_scan import frames
from semmap_log.store.records import MAGIC

USUAL = 300
SECTOR = 512
BORDER = 40
"""Bytes around the ends of a file and of its commits at which most cuts are made."""

Drawn = tuple[str, Damage, int]
"""In words, what does it, and how many commits at the end may be missing then."""


def closed(plan: Plan) -> Generator[Outcome, None, None]:
    """Damage whole files, and have every verb, reader and writer say what it makes of the log."""
    yield from side_by_side(_share, plan)


def _share(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    folder = plan.folder / f"closed-{share}"
    chains = make_chains(folder / "chains")
    with Oracle() as oracle:

        @cache
        def examined(chain: int) -> Examined:
            return Examined(chains[chain].log, folder / chains[chain].title, oracle)

        for turn in plan.turns(USUAL, share, shares):
            yield try_one(plan, chains, examined, turn)


def try_one(
    plan: Plan, chains: list[Chain], examined: Callable[[int], Examined], turn: int
) -> Outcome:
    """Do one damage, which the seed and the turn alone decide.

    Args:
        plan: Has the seed.
        chains: The logs.
        examined: Gives of each, by its place, what it says while it is whole.
        turn: Which damage.
    """
    dice = random.Random(f"{plan.seed} {turn}")
    place = dice.randrange(len(chains))
    chain, log = chains[place], examined(place)
    what, damage, may_lose = _Files(chain, log.whole, dice).draw()
    findings = log.try_damage(damage, turn, may_lose=may_lose)
    said = f"{turn}: {chain.title} log, {what}"
    if not (findings.problems or findings.lost):
        return Outcome(said, log.commits)
    kept = keep(log.copy, plan.keep, said)
    return Outcome(said, log.commits, findings.lost, 0, "\n".join(findings.problems), kept)


class _Files:
    """Draws a damage to the files of a log."""

    def __init__(self, chain: Chain, log: Path, dice: random.Random) -> None:
        self._chain = chain
        self._log = log
        self._dice = dice
        self._segments = sorted(log.glob("*.mcap"))
        self._others = [p for p in sorted(log.iterdir()) if p not in self._segments]

    def draw(self) -> Drawn:
        """Return a damage: of a segment, most times; of another file; or of one of each."""
        ways = [self._of_segment] * 6 + [self._next_to]
        ways += [self._of_other] * 2 if self._others else []
        ways += [self._of_both] * 2 if len(self._others) > 1 else []
        return self._dice.choice(ways)()

    def _of_both(self) -> Drawn:
        """Draw a damage of a segment, and one of one of the files that tell of it."""
        what, damage, may_lose = self._of_segment()
        other, damage_other, _ = self._of_other()
        return f"{what}, and {other}", lambda log: (damage(log), damage_other(log)), may_lose

    def _of_segment(self) -> Drawn:
        name = self._dice.choice(self._segments).name
        ways: list[Callable[[str], Drawn]] = [self._cut, self._cut, self._zeroed, self._missing]
        if name in self._chain.early:
            ways += [self._older]
        if self._chain.diverged is not None and not (self._is_live(name)):
            ways += [self._diverged, self._diverged]
        if len(self._segments) > 1:
            ways += [self._swapped]
        ways += [self._doubled, self._sector, self._sector, self._renamed, self._foreign]
        return self._dice.choice(ways)(name)

    def _of_other(self) -> Drawn:
        name = self._dice.choice(self._others).name
        ways: list[Callable[[str], Drawn]] = [self._cut, self._zeroed, self._missing, self._garbage]
        ways += [self._older] if name in self._chain.early else []
        if self._chain.diverged is not None and (self._chain.diverged / name).exists():
            ways += [self._diverged]
        what, damage, _ = self._dice.choice(ways)(name)
        return what, damage, 0

    def _cut(self, name: str) -> Drawn:
        data = (self._log / name).read_bytes()
        size = self._place(name, len(data))
        what = f"{name} cut to {size} of {len(data)} bytes"
        return what, partial(_put, name=name, data=data[:size]), self._may_lose(name, data[:size])

    def _zeroed(self, name: str) -> Drawn:
        data = bytearray((self._log / name).read_bytes())
        start = self._place(name, len(data))
        size = min(self._dice.choice((1, 16, 512, 4096, len(data))), len(data) - start)
        data[start : start + size] = bytes(size)
        what = f"{name} zeroed from byte {start} to {start + size}"
        return what, partial(_put, name=name, data=bytes(data)), self._may_lose(name, bytes(data))

    def _missing(self, name: str) -> Drawn:
        return f"{name} missing", partial(_remove, name=name), self._may_lose(name, b"")

    def _garbage(self, name: str) -> Drawn:
        data = self._dice.randbytes(self._dice.choice((1, 100, 10_000)))
        return f"{name} full of garbage", partial(_put, name=name, data=data), 0

    def _older(self, name: str) -> Drawn:
        older = self._dice.choice(self._chain.early[name]).read_bytes()
        what = f"{name} as it was when it had {len(older)} bytes"
        may_lose = self._missing_of_live(name, older) if self._is_live(name) else 0
        return what, partial(_put, name=name, data=older), may_lose

    def _diverged(self, name: str) -> Drawn:
        assert self._chain.diverged is not None
        data = (self._chain.diverged / name).read_bytes()
        what = f"{name} of a copy that went on differently"
        return what, partial(_put, name=name, data=data), 0

    def _swapped(self, name: str) -> Drawn:
        other = self._dice.choice([p.name for p in self._segments if p.name != name])
        return f"{name} and {other} swapped", partial(_swap, one=name, other=other), 0

    def _doubled(self, name: str) -> Drawn:
        return f"{name} there twice", partial(_copy, name=name, to="again_000009.mcap"), 0

    def _sector(self, name: str) -> Drawn:
        """Draw a sector that a disk gives back as it once was, as garbage, or as another one."""
        data = (self._log / name).read_bytes()
        at = self._place(name, len(data)) // SECTOR * SECTOR
        source = self._dice.choice(self._segments).read_bytes()
        other = self._dice.randrange(len(source) // SECTOR + 1) * SECTOR
        older = self._dice.choice(self._chain.early[name]) if name in self._chain.early else None
        what, sector = self._dice.choice((
            ("full of garbage", self._dice.randbytes(SECTOR)),
            ("as it once was", older.read_bytes()[at : at + SECTOR] if older else b""),
            ("written over the next one", data[max(0, at - SECTOR) : at]),
            (f"from byte {other} of a segment", source[other : other + SECTOR]),
        ))  # fmt: skip
        sector = sector.ljust(SECTOR, b"\0")[: len(data) - at]
        damaged = data[:at] + sector + data[at + len(sector) :]
        what = f"{name}: the sector at byte {at} {what}"
        return what, partial(_put, name=name, data=damaged), self._may_lose(name, damaged)

    def _renamed(self, name: str) -> Drawn:
        if self._dice.random() < 0.5:
            return f"{name} renamed", partial(_move, name=name, to="moved_000007.mcap"), 0
        return f"{name} a link to where it was put", partial(_link, name=name), 0

    def _foreign(self, name: str) -> Drawn:
        data = self._dice.choice(sorted(self._chain.foreign.glob("*.mcap"))).read_bytes()
        if self._is_live(name) or self._dice.random() < 0.5:
            return "a segment of another log", partial(_put, name="zz_000003.mcap", data=data), 0
        return f"{name} from another log", partial(_put, name=name, data=data), 0

    def _next_to(self) -> Drawn:
        """Draw what else lies in the folder."""
        what, plant = self._dice.choice(list(ADJACENT.items()))
        return what, plant, 0

    def _place(self, name: str, size: int) -> int:
        """Draw a place in a file: often near its ends, or the ends of what is in it."""
        if self._dice.random() < 0.4:
            return self._dice.randrange(size)
        places = [0, size]
        if name.endswith(".mcap"):
            places += [place for both in commit_places(self._log / name) for place in both]
            places += _borders((self._log / name).read_bytes())
        near = self._dice.choice(places) + self._dice.randint(-BORDER, BORDER)
        return min(max(near, 0), size - 1)

    def _is_live(self, name: str) -> bool:
        return self._chain.is_live and name == self._segments[-1].name

    def _may_lose(self, name: str, data: bytes) -> int:
        """Return how many commits a crash may have torn off if a file has these bytes now."""
        if not self._is_live(name):
            return 0
        if not data:
            return len(commit_places(self._log / name))
        whole = (self._log / name).read_bytes()
        touched = [whole[a:b] != data[a:b] for a, b in commit_places(self._log / name)]
        return len(touched) - touched.index(True) if any(touched) else 0

    def _missing_of_live(self, name: str, data: bytes) -> int:
        places = commit_places(self._log / name)
        return sum(end > len(data) for _, end in places) or self._may_lose(name, data)


def _put(log: Path, *, name: str, data: bytes) -> None:
    """Give a file other bytes, as who copies does: readers keep the old ones."""
    made = log / ".made"
    made.write_bytes(data)
    made.replace(log / name)


def _remove(log: Path, *, name: str) -> None:
    (log / name).unlink()


def _move(log: Path, *, name: str, to: str) -> None:
    (log / name).rename(log / to)


def _link(log: Path, *, name: str) -> None:
    (log / "elsewhere").mkdir()
    (log / name).rename(log / "elsewhere" / name)
    (log / name).symlink_to(Path("elsewhere") / name)


def _litter(log: Path) -> None:
    for name in (
        "notes.txt",
        ".hidden",
        "log_000000.mcap.torn-1",
        "log_000000.mcap.bak",
        "a.mcap~",
    ):
        (log / name).write_bytes(b"mine")
    (log / "a folder").mkdir()


ADJACENT: dict[str, Damage] = {
    "files of others": _litter,
    "an empty segment": lambda log: (log / "x_000009.mcap").touch(),
    "a text named as a segment": lambda log: (log / "x.mcap").write_bytes(b"hello"),
    "a folder named as a segment": lambda log: (log / "x.mcap").mkdir(),
    "a pipe named as a segment": lambda log: os.mkfifo(log / "x.mcap"),
    "a link to nothing named as a segment": lambda log: (log / "x.mcap").symlink_to("nowhere"),
    "a link to itself named as a segment": lambda log: (log / "x.mcap").symlink_to("x.mcap"),
    "a link to a segment beside it": lambda log: (log / "x.mcap").symlink_to(
        min(log.glob("*.mcap")).name
    ),
}
"""In words -> what plants it in a log's folder."""


def _borders(data: bytes) -> list[int]:
    """Return where records end: nothing torn shows there."""
    return [at + length for _, at, length in frames(data, len(MAGIC), len(data))]


def _swap(log: Path, *, one: str, other: str) -> None:
    (log / one).rename(log / "swapping")
    (log / other).rename(log / one)
    (log / "swapping").rename(log / other)


def _copy(log: Path, *, name: str, to: str) -> None:
    shutil.copy2(log / name, log / to)
