"""Whole files missing, doubled, renamed, exchanged, foreign; and what else lies in the folder."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from fault_injection.closed import ADJACENT
from fault_injection.judging import TELL_THE_END, remove_all
from fault_injection.sample import Sample

import semmap_log as sl
from semmap_log.errors import CorruptLogError, LogAccessError, NotALogError


@pytest.mark.parametrize("name", ["log_000000.mcap", "log_000001.mcap"])
def test_a_missing_segment_is_named_by_its_number(
    name: str, sample: Sample, tmp_path: Path
) -> None:
    """Opening says which one, and where the gap shows."""
    log = tmp_path / "log"
    shutil.copytree(sample.closed, log)
    (log / name).unlink()

    with pytest.raises(CorruptLogError, match=f"expected segment {int(name[4:10])} .*missing"):
        sl.read(log)


def test_a_middle_segment_that_ends_early_answers_no_question(
    sample: Sample, tmp_path: Path
) -> None:
    """Closed, whole by all its checksums, and of an earlier day."""
    early, log = tmp_path / "early" / "log", tmp_path / "log"
    early.mkdir(parents=True)
    shutil.copy2(sample.closed / "log_000000.mcap", early)
    shutil.copy2(sample.older / "log_000001.mcap", early)
    sl.append(early, compact=False).close()
    shutil.copytree(sample.closed, log)
    shutil.copy2(early / "log_000001.mcap", log)
    gone = sample.commits[9]

    for ask in (
        lambda: list(sl.read(log).batches()),
        lambda: list(sl.read(log).commits()),
        lambda: sl.read(log).replay(known_at=gone.recorded_ns),
        lambda: sl.read(log).event(gone.first_event),
    ):
        with pytest.raises(CorruptLogError, match="log_00000"):
            ask()


@pytest.mark.parametrize("damage", ["renamed", "reversed", "a link", "files of others", "no marks"])
def test_files_that_are_all_there_answer_as_before(
    damage: str, sample: Sample, tmp_path: Path
) -> None:
    """Whatever they are called, wherever they lie, and whatever lies beside them."""
    log = Path(shutil.copytree(sample.closed, tmp_path / "log"))
    expected = repr(sl.read(log).replay()), [commit.hash for commit in sl.read(log).commits()]
    files = sorted(log.glob("*.mcap"))
    if damage == "renamed":
        files[1].rename(log / "moved_000007.mcap")
    elif damage == "reversed":
        for number, path in enumerate(reversed(files)):
            path.rename(log / f"reversed_{number:06d}.mcap")
    elif damage == "a link":
        (tmp_path / "elsewhere").mkdir()
        files[1].rename(tmp_path / "elsewhere" / "made.mcap")
        files[1].symlink_to("../elsewhere/made.mcap")
    elif damage == "files of others":
        ADJACENT["files of others"](log)
    else:
        remove_all(log, TELL_THE_END)

    for _ in ("reading", "appending"):
        opened = sl.read(log)
        assert expected == (repr(opened.replay()), [commit.hash for commit in opened.commits()])
        sl.append(log, compact=False).close()


@pytest.mark.parametrize("beside", [name for name in ADJACENT if name != "files of others"])
def test_what_is_no_segment_is_refused_by_its_name(
    beside: str, sample: Sample, tmp_path: Path
) -> None:
    """Reading and appending; a second link to a segment is harmless, or an error."""
    log = Path(shutil.copytree(sample.closed, tmp_path / "log"))
    expected = repr(sl.read(log).replay())
    ADJACENT[beside](log)

    def refused_or_harmless(ask: Callable[[], str | None]) -> None:
        try:
            assert ask() in {expected, None}
            assert "a link to a segment" in beside
        except (CorruptLogError, NotALogError, LogAccessError) as error:
            assert ".mcap" in str(error)

    refused_or_harmless(lambda: repr(sl.read(log).replay()))
    refused_or_harmless(lambda: sl.append(log).close())
