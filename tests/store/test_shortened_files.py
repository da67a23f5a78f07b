"""Files cut under an open reader: every answer is right, or an error; never a signal."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from subprocess import PIPE

import pytest

import semmap_log as sl
from semmap_log.store.compaction import compact
from semmap_log.store.reading.segment_scan import open_segment
from tests.store.logs import segment_files, write_log

CUTS = (0, 8192, -5000)
"""To what the file is cut; negative: by so much."""

Damage = Callable[[Path], None]


@pytest.fixture(scope="module", params=["live", "plain", "compacted"])
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of some segments; of the first kind the last is live."""
    folder = tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("semmap_log.store.writing.segment_chain.ROLL_COMMITS", 120)
        write_log(folder / "made" / "log", 300, per_commit=3)
    log = folder / "made" / "log"
    if request.param == "live":
        last = segment_files(log)[-1]
        last.write_bytes(last.read_bytes()[: _data_end(last)])
        (log / "metadata.yaml").unlink()
    elif request.param == "compacted":
        compact(log, keep_s=0)
    return log


def _data_end(path: Path) -> int:
    segment = open_segment(path)
    return int(segment.chunks.rows["behind"][-1])


def asked(log: Path, whole: Path, damage: Damage, *more: str) -> list[tuple[str, str, str]]:
    """Open a log in another process, damage it, and return what it says then."""
    with subprocess.Popen(
        [sys.executable, "-m", "tests.store.asking", str(log), str(whole), "--wait", *more],
        stdin=PIPE, stdout=PIPE, text=True,
    ) as reader:  # fmt: skip
        assert reader.stdout is not None
        assert "open\n" == reader.stdout.readline()
        damage(log)
        told, _ = reader.communicate("go on\n")
    assert 0 == reader.returncode
    return [tuple(one) for one in json.loads(told)]


@cache
def right_answers(whole: Path) -> dict[str, str]:
    """Return what the log says, by question."""
    return {name: text for name, _, text in asked(whole, whole, lambda _: None)}


def check(whole: Path, told: list[tuple[str, str, str]], named: str) -> None:
    """Check that answers are right, and errors name the file."""
    right = right_answers(whole)
    for name, kind, text in told:
        assert (right[name] == text) if kind == "answer" else (named in text), (name, text)


def _copied(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "log"))


def _cut(file: Path, to: int) -> None:
    os.truncate(file, to if to >= 0 else file.stat().st_size + to)


@pytest.mark.slow
@pytest.mark.parametrize("to", CUTS)
@pytest.mark.parametrize("which", [0, -1])
def test_a_file_cut_under_an_open_reader(whole: Path, which: int, to: int, tmp_path: Path) -> None:
    """By its name, as `cp` does over a mirror: what was read before is of no use any more."""
    name = segment_files(whole)[which].name

    told = asked(_copied(whole, tmp_path), whole, lambda log: _cut(log / name, to))

    check(whole, told, name)
    assert to != 0 or any(kind == "error" for _, kind, _ in told)


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("--fallback", "ask")], ids=["copied", "asked for"])
@pytest.mark.parametrize("to", CUTS)
def test_a_file_cut_that_has_lost_its_name(
    whole: Path, to: int, more: tuple[str, ...], tmp_path: Path
) -> None:
    """Replaced, so that only the mapping holds it, and then cut by another of its names."""

    def replace_and_cut(log: Path) -> None:
        os.link(log / name, tmp_path / "other")
        (log / "new").write_bytes((log / name).read_bytes())
        (log / "new").rename(log / name)
        _cut(tmp_path / "other", to)

    name = segment_files(whole)[0].name

    told = asked(_copied(whole, tmp_path), whole, replace_and_cut, *more)

    check(whole, told, name)
    assert to != 0 or any(kind == "error" for _, kind, _ in told)


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("--fallback", "ask"), ("--fallback", "look")], ids=str)
def test_a_log_that_is_moved_away_is_read_on(
    whole: Path, more: tuple[str, ...], tmp_path: Path
) -> None:
    """Whichever way its bytes are copied: all answers are as they were."""
    log = _copied(whole, tmp_path)

    told = asked(log, whole, shutil.rmtree, *more)

    assert {"answer"} == {kind for _, kind, _ in told}
    check(whole, told, "")


@pytest.mark.slow
def test_a_file_cut_and_restored_over_and_over(whole: Path, tmp_path: Path) -> None:
    """A mirror that is written anew again and again, beside two that read it."""
    log = _copied(whole, tmp_path)
    right = right_answers(whole)
    command = [sys.executable, "-m", "tests.store.asking", str(log), str(whole), "--rounds", "20"]
    readers = [
        subprocess.Popen([*command, "--wait", *how], stdin=PIPE, stdout=PIPE, text=True)
        for how in ((), ("--refresh",))
    ]
    for reader in readers:
        assert reader.stdout is not None
        assert "open\n" == reader.stdout.readline()
    # Not one that is live: what is left of that is a log, only a shorter one.
    closed = [path for path in segment_files(log) if open_segment(path).closed]
    files = [(path, path.read_bytes()) for path in closed]

    told = _while_writing(readers, files)

    for name, kind, text in told:
        assert kind == "error" or right[name] == text, name
    assert all(reader.returncode == 0 for reader in readers)
    assert {name for name, _, _ in told} == set(right)


def _while_writing(
    readers: list[subprocess.Popen[str]], files: list[tuple[Path, bytes]]
) -> list[tuple[str, str, str]]:
    """Cut and restore files, piece by piece, until all readers have ended; return what they say."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(len(readers)) as pool:
        ends = [pool.submit(reader.communicate, "go on\n") for reader in readers]
        turn = 0
        while not all(end.done() for end in ends):
            path, data = files[turn % len(files)]
            with path.open("wb", buffering=0) as file:
                for at in range(0, len(data), 10_000):
                    file.write(data[at : at + 10_000])
            turn += 1
    return [tuple(one) for end in ends for one in json.loads(end.result()[0])]


def test_the_error_says_what_happened(tmp_path: Path) -> None:
    """File, place, and the two lengths."""
    log = write_log(tmp_path / "log", 50)
    (file,) = segment_files(log)
    opened, size = sl.read(log), file.stat().st_size
    os.truncate(file, 3000)

    with pytest.raises(
        sl.SemmapError,
        match=rf"{file.name}: cannot be read at byte [0-9]+: the file had {size} bytes when it was "
        "opened; it was cut to 3000",
    ):
        opened.replay()
