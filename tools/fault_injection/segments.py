"""Whole files missing, doubled, renamed, exchanged or foreign; and what lies beside them."""

from __future__ import annotations

import os
import random
import shutil
from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path

from mcap.opcode import Opcode

import semmap_log as sl
from fault_injection.fault import Outcome, Plan
from fault_injection.judging import Verdict, WrongAnswerError, copy_of
from fault_injection.sample import (
    COMMITS_A_SEGMENT,
    NAME,
    Sample,
    SteadyClock,
    make_sample,
    small_segments,
)
from fault_injection.subject import MARKS, TELL_THE_END, Subject, remove_all
from semmap_log.store import records as mcap
from semmap_log.store.record_scan import frames

Damage = tuple[str, Callable[[Path], object], str, int, Verdict | None]
"""In words, what does it, the file that an error must name, how many commits at the end may be
missing, and what must come out (None: harmless or refused, both are right)."""

REFUSED, HARMLESS, TORN = Verdict.REFUSED, Verdict.HARMLESS, Verdict.TORN
FIRST, MIDDLE, LAST = (f"{NAME}_{number:06d}.mcap" for number in range(3))
TORN_BY_CUT = 2
"""The older version of the last segment has so many commits less."""


def segments(plan: Plan) -> Generator[Outcome, None, None]:
    """Do to the files of logs what people, copies and disks do to them.

    Of a live one, a closed one, and a closed one without what tells where it ended.
    """
    sample = make_sample(plan.folder / "sample")
    other = another_log(plan.folder / "other")
    early = closed_early(sample, plan.folder / "early")
    dice = random.Random(plan.seed)
    for title, path, told in (
        ("live", sample.live, True),
        ("closed", sample.closed, True),
        ("untold", sample.closed, False),
    ):
        log = Subject.of(path, plan.folder, title, last_commits=COMMITS_A_SEGMENT, told=told)
        damages = list(damages_of(log, sample, other, early))
        dice.shuffle(damages)
        for what, do, named, may_lose, expected in damages:
            for judged_by, suffix in (
                (log.judge.judge, ""),
                (log.judge.judge_appending, ", opened for appending"),
            ):
                with copy_of(log.log) as copy:
                    do(copy)
                    ask = partial(judged_by, copy, named, may_lose=may_lose)
                    judged = partial(_as_expected, ask, expected)
                    yield log.outcome(plan, f"{what}{suffix}", judged, copy)


def another_log(folder: Path) -> Path:
    """Write a log with the same names, numbers and sizes, that is another one."""
    path = folder / NAME
    with small_segments(), sl.create(path, tz="UTC", compact=False, clock=SteadyClock()) as log:
        for _ in range(3 * COMMITS_A_SEGMENT):
            log.add_door()
    return path


def closed_early(sample: Sample, folder: Path) -> Path:
    """Return a log of the first two segments, whole, the second closed after some commits."""
    path = folder / NAME
    path.mkdir(parents=True)
    shutil.copy2(sample.closed / FIRST, path)
    shutil.copy2(sample.older / MIDDLE, path)
    sl.append(path, compact=False).close()
    return path


def damages_of(log: Subject, sample: Sample, other: Path, early: Path) -> Iterator[Damage]:
    """Yield everything that is done to whole files of a log."""
    yield from _missing_and_moved()
    yield from _ended_early(sample, is_known=log.is_end_known)
    yield from _from_elsewhere(sample, other, early)
    yield from _shortened(log)
    yield from _beside_the_segments()


def _missing_and_moved() -> Iterator[Damage]:
    """Yield what a careless hand does."""
    yield "first segment missing", lambda p: (p / FIRST).unlink(), "log", 0, REFUSED
    yield "middle segment missing", lambda p: (p / MIDDLE).unlink(), "log", 0, REFUSED
    for one, other in ((FIRST, MIDDLE), (MIDDLE, LAST), (FIRST, LAST)):
        yield f"{one} and {other} swapped", partial(_swap, one=one, other=other), "log_", 0, None
    for name in (FIRST, MIDDLE, LAST):
        copied = partial(_copy, name=name, to="again_000009.mcap")
        yield f"{name} there twice", copied, ".mcap", 0, None
        moved = partial(_move, name=name, to="moved_000007.mcap")
        yield f"{name} renamed", moved, "log", 0, HARMLESS
        linked = partial(_link, name=name)
        yield f"{name} a symbolic link to where it was put", linked, "log", 0, HARMLESS
    yield "named in reverse order", _reverse, "log", 0, HARMLESS


def _ended_early(sample: Sample, *, is_known: bool) -> Iterator[Damage]:
    """Yield logs that end earlier than they did.

    Where no mark tells how far it reached, no log can know that by itself: `verify
    --head` is for that. Without a mark, metadata.yaml tells that a closed segment is missing.
    """
    older = partial(_replace, name=LAST, source=sample.older / LAST)
    for what, do, named, lost in (
        ("last segment missing", partial(_remove, names=(LAST,)), "closed-",
         COMMITS_A_SEGMENT),
        (f"an older version of {LAST}", older, LAST, TORN_BY_CUT),
    ):  # fmt: skip
        yield (what, do, named, 0, REFUSED) if is_known else (what, do, "", lost, TORN)
        untold = partial(_then_remove, do=do, names=MARKS)
        without = f"{what}, its marks missing"
        yield (without, untold, "", 0, REFUSED) if is_known else (without, untold, "", lost, TORN)
        untold = partial(_then_remove, do=do, names=TELL_THE_END)
        yield f"{what}, and all that tells of it", untold, "", lost, TORN


def _from_elsewhere(sample: Sample, other: Path, early: Path) -> Iterator[Damage]:
    """Yield segments of other logs and of other days."""
    for name in (FIRST, MIDDLE, LAST):
        foreign = partial(_replace, name=name, source=other / name)
        yield f"{name} from another log", foreign, "", 0, REFUSED
        added = partial(_replace, name="zz_000003.mcap", source=other / name)
        yield f"{name} of another log beside them", added, "", 0, REFUSED
    for name in (FIRST, MIDDLE):
        older = partial(_replace, name=name, source=sample.older / name)
        expected = HARMLESS if name == FIRST else REFUSED  # the first: not yet compacted
        yield f"an older version of {name}", older, "log_", 0, expected
    shorter = partial(_replace, name=MIDDLE, source=early / MIDDLE)
    yield f"{MIDDLE} as it was when it was closed too early", shorter, "log_", 0, REFUSED


def _shortened(log: Subject) -> Iterator[Damage]:
    """Yield cuts on the borders of records: nothing torn shows there."""
    for name in (FIRST, MIDDLE):
        for border in _borders((log.log / name).read_bytes()):
            cut = partial(_cut, name=name, size=border)
            yield f"{name} ends with the record at byte {border}", cut, name, 0, REFUSED
    whole = (log.log / LAST).read_bytes()
    for border in (b for b in _borders(whole) if b >= log.places[0][0]):
        may_lose = log.may_lose(LAST, whole[:border])
        cut = partial(_cut, name=LAST, size=border)
        expected = TORN if may_lose else None
        if log.is_end_known and any(end > border for _, end in log.places):
            expected = REFUSED
        yield f"{LAST} ends with the record at byte {border}", cut, LAST, may_lose, expected


def _beside_the_segments() -> Iterator[Damage]:
    """Yield what else may lie in the folder: metadata.yaml is a cache, the rest is not ours."""
    bag = "metadata.yaml"
    yield f"{bag} missing", partial(_remove, names=(bag,)), "", 0, HARMLESS
    yield "marks missing", partial(_remove, names=MARKS), "", 0, HARMLESS
    for title, text in (
        ("garbage", b"\xff\xfe: [\0"),
        ("empty", b""),
        ("of another bag", b"rosbag2_bagfile_information:\n  version: 9\n  files: []\n"),
    ):
        yield f"{bag} {title}", partial(_write, name=bag, data=text), "", 0, HARMLESS
    yield "files of others", _litter, "", 0, HARMLESS
    yield "an empty segment", partial(_write, name="x_000009.mcap", data=b""), "x_", 0, REFUSED
    text = partial(_write, name="x.mcap", data=b"hello")
    yield "a text named as a segment", text, "x.mcap", 0, REFUSED
    yield "a folder named as a segment", lambda p: (p / "x.mcap").mkdir(), "x.mcap", 0, REFUSED
    yield "a pipe named as a segment", lambda p: os.mkfifo(p / "x.mcap"), "x.mcap", 0, REFUSED
    dangling = partial(_point, name="x.mcap", to="nowhere")
    yield "a link to nothing named as a segment", dangling, "x.mcap", 0, REFUSED
    loop = partial(_point, name="x.mcap", to="x.mcap")
    yield "a link to itself named as a segment", loop, "x.mcap", 0, REFUSED
    again = partial(_point, name="x.mcap", to=FIRST)
    yield "a link to the first segment beside it", again, ".mcap", 0, None


def _as_expected(ask: Callable[[], Verdict], expected: Verdict | None) -> Verdict:
    verdict = ask()
    if verdict is not expected and (expected is not None or verdict is TORN):
        wanted = "harmless or an error" if expected is None else expected.value
        raise WrongAnswerError(f"expected {wanted}, got {verdict.value}")
    return verdict


def _borders(data: bytes) -> list[int]:
    """Return where the records end, schemas and channels left out."""
    skipped = (Opcode.SCHEMA, Opcode.CHANNEL)
    found = frames(data, len(mcap.MAGIC), len(data))
    borders = [at + length for opcode, at, length in found if opcode not in skipped]
    return [border for border in borders if border < len(data)]


def _remove(log: Path, *, names: tuple[str, ...]) -> None:
    remove_all(log, names)


def _then_remove(log: Path, *, do: Callable[[Path], object], names: tuple[str, ...]) -> None:
    do(log)
    _remove(log, names=names)


def _swap(log: Path, *, one: str, other: str) -> None:
    _move(log, name=one, to="swapping")
    _move(log, name=other, to=one)
    _move(log, name="swapping", to=other)


def _reverse(log: Path) -> None:
    for number, path in enumerate(sorted(log.glob("*.mcap"), reverse=True)):
        path.rename(log / f"reversed_{number:06d}.mcap")


def _copy(log: Path, *, name: str, to: str) -> None:
    shutil.copy2(log / name, log / to)


def _move(log: Path, *, name: str, to: str) -> None:
    (log / name).rename(log / to)


def _link(log: Path, *, name: str) -> None:
    (log / "elsewhere").mkdir()
    (log / name).rename(log / "elsewhere" / name)
    (log / name).symlink_to(Path("elsewhere") / name)


def _point(log: Path, *, name: str, to: str) -> None:
    (log / name).symlink_to(to)


def _replace(log: Path, *, name: str, source: Path) -> None:
    shutil.copy2(source, log / name)


def _write(log: Path, *, name: str, data: bytes) -> None:
    (log / name).write_bytes(data)


def _cut(log: Path, *, name: str, size: int) -> None:
    os.truncate(log / name, size)


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
