"""`recover` as a user types it: shown first, done when told, and nothing twice."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from semmap_log.store.reading.segment_scan import open_segment
from tests.golden_text import GoldenText
from tests.store.eventful import contents, eventful_log, flip
from tests.verbs import Verb, ran

pytestmark = pytest.mark.usefixtures("terminal")


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return eventful_log(tmp_path_factory.mktemp("original") / "log")


@pytest.fixture
def log(original: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log that lost its second commit, the door `back`."""
    monkeypatch.chdir(tmp_path)
    log = Path(shutil.copytree(original, tmp_path / "log"))
    file = log / "log_000000.mcap"
    flip(file, open_segment(file).chunks[2].data_offset + 40)
    return log


def test_without_yes_it_only_shows(log: Path, run_verb: Verb, golden: GoldenText) -> None:
    """Exit code 4: there is something to do. No byte is written."""
    before = contents(log)

    code, out, _ = run_verb("recover", "log")

    assert 4 == code
    assert before == contents(log)
    assert all(len(line) <= 80 for line in out.splitlines())
    golden("recover", "without --yes", re.sub("its CRC .*", "…", out))


@pytest.mark.slow
def test_in_place(log: Path, capsys) -> None:
    """Then the log is good, says so, and there is nothing to do any more."""
    done = ran(capsys, "recover", "log", "--yes")
    again = ran(capsys, "recover", "log", "--yes")

    assert (0, 0) == (done[0], again[0])
    assert "log: saved 11 events in 10 commits" in " ".join(done[1].split())
    assert "damaged-1" in done[1]
    assert "nothing to recover" in " ".join(again[1].split())
    assert 0 == ran(capsys, "verify", "log")[0]
    last = json.loads(ran(capsys, "history", "log", "--json")[1])[-1]
    assert "semmap-log recover" == last["actor"]
    assert "events 2..3" in last["reason"]


def test_into_another_folder_as_json(log: Path, capsys) -> None:
    """One document: what was lost, and where the new log is; the damaged one stays."""
    before = contents(log)

    code, out, _ = ran(capsys, "recover", "log", "--out", "saved", "--yes", "--json")

    said = json.loads(out)
    (lost,) = said["lost"]
    assert 0 == code
    assert before == contents(log)
    assert (2, 3, ["log_000000.mcap"]) == (lost["first_event"], lost["last_event"], lost["files"])
    assert (2, 11, [2], False) == tuple(
        said[key] for key in ("lost_events", "events", "doors_without_adding", "keeps_numbers")
    )
    assert str(log.parent / "saved") == said["log"]
    assert 0 == ran(capsys, "verify", "saved")[0]


def test_a_good_log_and_no_log(original: Path, tmp_path: Path, capsys) -> None:
    """0 with nothing to do, also without --yes; 1 where there is no log."""
    good = Path(shutil.copytree(original, tmp_path / "good"))

    for more in ([], ["--yes"], ["--out", tmp_path / "new", "--yes"]):
        code, out, _ = ran(capsys, "recover", good, *more)
        assert 0 == code
        assert "nothing to recover" in " ".join(out.split())
    code, _, err = ran(capsys, "recover", tmp_path / "nolog", "--yes")

    assert 1 == code
    assert "nolog" in err
    assert not (tmp_path / "new").exists()


def test_a_torn_tail_is_left_to_the_next_writer(original: Path, tmp_path: Path, capsys) -> None:
    """It is said, and 0."""
    torn = tmp_path / "torn"
    torn.mkdir()
    data = (original / "log_000000.mcap").read_bytes()
    end = open_segment(original / "log_000000.mcap").chunks[-1].offset
    (torn / "log_000000.mcap").write_bytes(data[: end + 9])

    code, out, _ = ran(capsys, "recover", torn)

    assert 0 == code
    assert "torn tail, which the next writer puts in order" in out.replace("\n", " ")
