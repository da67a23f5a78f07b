"""`probabilities` as a user types it."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import EarlyEventsWarning
from tests.analysis.beliefs.patrolled import patrolled
from tests.conftest import SteadyClock
from tests.verbs import run

pytestmark = pytest.mark.usefixtures("terminal")

RECORDINGS = Path(__file__).parents[2] / "recordings"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    patrolled(folder / "log")
    sl.create(folder / "empty", tz="UTC", clock=SteadyClock()).close()
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log of a patrol by day, and an empty one."""
    shutil.copytree(made, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


def said(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert 0 == run("probabilities", *arguments)
    return capsys.readouterr().out


def flat(text: str) -> str:
    """The text without its line breaks."""
    return " ".join(text.split())


def test_the_table_tells_numbers_evidence_and_the_night(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row a door, UNKNOWN with why, and what nobody has seen in words."""
    out = said(capsys, "log")

    front, store, attic = (next(line for line in out.splitlines() if f" {name} " in line)
                           for name in ("front", "store", "attic"))  # fmt: skip
    assert ["15.2", "365", "364", "0", "s", "77"] == front.split()[-6:]
    assert "UNKNOWN" not in front + store
    assert "UNKNOWN" in attic
    assert "UNKNOWN, never seen: attic" in out
    assert "never seen: 20:00-07:00 (front, store)" in out
    assert "what is said of an hour never seen is carried over from other hours" in out


@pytest.mark.slow
@pytest.mark.parametrize("by", [[], ["--by", "hour"], ["--by", "weekday"], ["--by", "week"]])
def test_132_doors_with_long_names_fit_80_columns(
    by: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """No line is longer, none has colours in a pipe, and every door is there, by its number."""
    out = said(capsys, str(RECORDINGS / "clinic_week"), *by)

    assert max(map(len, out.splitlines())) <= 80
    assert "\x1b" not in out
    ids = {int(found) for found in re.findall(r"^ *(\d+)(?= |$)", out, flags=re.MULTILINE)}
    assert {door_id for door_id in range(1, 134) if door_id != 33} <= ids


def test_names_that_would_steer_the_terminal_are_spelt_out(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with sl.append("log") as log:
        log.annotate(1, "name", "evil\x1b[31m\nname")

    outs = [said(capsys, "log", *by) for by in ([], ["--by", "hour"], ["--by", "week"])]

    assert all("\x1b" not in out and "evil" in out for out in outs)


def test_one_json_document_has_it_all(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Field names as in the events; times in UTC; what is unknown says so."""
    arguments = ("log", "front", "attic", "--known-at", "2026-03-27T12:00", "--json")
    found = json.loads(said(capsys, *arguments))

    front, attic = found["doors"]
    assert ("2026-03-27T11:00:00.000000000Z", "Europe/Vienna", 0.9) == (
        found["known_at"], found["tz"], found["interval"]
    )  # fmt: skip
    assert found["known_at"] == found["time"]
    assert (1, "front", True) == (front["door_id"], front["name"], front["is_known"])
    assert 1.0 == front["p_open"] + front["p_closed"]
    assert front["low"] <= front["p_open"] <= front["high"]
    assert (325, "2026-03-26T18:30:00.000000000Z", 77) == (
        front["evidence"]["sightings"],
        front["evidence"]["last_seen"],
        front["evidence"]["hours_never_seen"],
    )
    assert ["20:00-07:00"] == front["evidence"]["never_seen"]
    assert not attic["is_known"]
    assert {"days": 0.0, "known_s": 0.0, "words": 1, "sightings": 0, "visits": 0,
            "last_seen": None, "age_s": None, "hours_never_seen": 168,
            "never_seen": ["at any hour"]} == attic["evidence"]  # fmt: skip


@pytest.mark.parametrize(("by", "shape"), [("hour", (24,)), ("weekday", (7,)), ("week", (7, 24))])
def test_typical_times_as_json(
    by: str, shape: tuple[int, ...], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Lists of 24 hours, of 7 days, or of 7 lists of 24; and which of them are known."""
    import numpy as np

    found = json.loads(said(capsys, "log", "front", "--by", by, "--json"))

    (front,) = found["doors"]
    assert by == found["by"]
    assert [shape] * 4 == [
        np.shape(front[name]) for name in ("p_open", "low", "high", "cell_is_known")
    ]


def test_the_map_of_the_week_reads_without_colours(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Seven rows of 24 digits; a dot where nobody looked; a legend."""
    out = said(capsys, "log", "front", "--by", "week")

    rows = {line[:3]: line[4:].split() for line in out.splitlines() if line[:3] in ("Mon", "Sun")}
    assert ["·"] * 7 == rows["Mon"][:7]
    assert ["·"] * 4 == rows["Mon"][20:]
    assert all(int(cell) >= 7 for cell in rows["Mon"][8:18])
    assert all(int(cell) <= 3 for cell in rows["Sun"][7:20])
    assert "tenths of P(open), 0: below .1, 9: from .9 on; ·: never seen then" in flat(out)
    assert "hours of Europe/Vienna" in flat(out)


def test_apply_fills_the_thesis_s_numbers(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two events, with who and why; the YAML carries them; a second time nothing is written."""
    codes = [run("probabilities", "log", "--apply", "--actor", "job", "--json")]
    found = json.loads(capsys.readouterr().out)
    codes.append(run("export", "log", "x.yaml", "--default-prob", "0.5"))
    codes.append(run("probabilities", "log", "--apply"))
    again = capsys.readouterr().err

    assert [0, 0, 0] == codes
    assert ([1, 2], [3], 2) == (
        found["applied"]["doors"], found["applied"]["unknown"], found["applied"]["count"]
    )  # fmt: skip
    front = found["doors"][0]
    assert f"closed_prob: {front['p_closed']}\n  open_prob: {front['p_open']}\n" in Path(
        "x.yaml"
    ).read_text(encoding="utf-8")
    assert "nothing was written: no door's numbers changed." in again
    entry = sl.read("log").entry(found["applied"]["event"])
    assert ("job", True) == (entry.actor, "as known at 2026-03-29 19:30" in entry.reason)


def test_an_empty_log_is_no_error(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """There is no door to tell of; to machines neither; and nothing to apply or draw."""
    table = said(capsys, "empty")
    document = json.loads(said(capsys, "empty", "--json"))
    codes = [run("probabilities", "empty", *more) for more in (["--apply"], ["--by", "week"],
                                                               ["--plot", "x.png"])]  # fmt: skip

    assert "No door is in the map then." in table
    assert [] == document["doors"]
    assert [0, 0, 0] == codes
    assert not Path("x.png").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["log", "nope"], 1, "nope"),
        (["log", "--estimator", "oracle"], 1, "oracle"),
        (["log", "--tz", "Nix/Da"], 1, "Nix/Da"),
        (["log", "--horizon", "soon"], 1, "such as 30m, 2h"),
        (["log", "--by", "month"], 2, "--by"),
        (["log", "--plot", "x.gif"], 2, ".png or .svg"),
        (["log", "--by", "week", "--apply"], 2, "--by, --plot"),
        (["log", "--by", "week", "--horizon", "2h"], 2, "--horizon"),
        (["log", "--actor", "me"], 2, "--apply"),
    ],
)
def test_mistakes_are_named(
    arguments: list[str], code: int, words: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line; exit code 1 for what the log does not have, 2 for what was mistyped."""
    assert code == run("probabilities", *arguments)
    assert words in flat(capsys.readouterr().err)


@pytest.mark.slow
def test_a_plot_is_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A PNG of the week; of the hours, with the table, as SVG."""
    pytest.importorskip("matplotlib", reason="pip install 'semmap-log[plots]'")

    codes = [
        run("probabilities", "log", "--plot", "week.png"),
        run("probabilities", "log", "front", "--by", "hour", "--plot", "hours.svg"),
    ]

    assert [0, 0] == codes
    assert b"\x89PNG" == Path("week.png").read_bytes()[:4]
    assert "P(open) over a typical day" in Path("hours.svg").read_text(encoding="utf-8")
    assert "front" in capsys.readouterr().out


def test_the_office_is_too_little_seen(capsys: pytest.CaptureFixture[str]) -> None:
    """One day tells no habits: all three doors are there, whatever is said of them."""
    out = said(capsys, str(RECORDINGS / "office"))

    assert all(name in out for name in ("main_door", "coe_door", "hardware_door"))
    assert "never seen: Tue-Sun" in out


@pytest.mark.slow
def test_who_asks_about_a_time_that_was_imported_later_is_told_why_nothing_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a CSV tells of last year was recorded today: as known last year there is nothing."""
    monkeypatch.chdir(tmp_path)
    Path("doors.csv").write_text(
        "timestamp,door,state\n2024-05-01T08:00,front,OPEN\n2024-05-20T08:00,front,CLOSED\n"
    )
    assert 0 == run("init", "log", "--tz", "UTC")
    assert 0 == run("import", "log", "doors.csv")
    capsys.readouterr()

    code = run("probabilities", "log", "--known-at", "2024-05-19")
    told = capsys.readouterr()
    assert 0 == run("probabilities", "log", "--at", "2024-05-19")
    now = capsys.readouterr()
    assert 1 == run("probabilities", "log", "--known-at", "2024-05-19", "--by", "hour")
    by_hour = capsys.readouterr()
    at = '--at "2024-05-19 00:00:00+00:00" --as-happened'
    typed = f"semmap-log probabilities {Path.cwd() / 'log'} {at}"
    assert 0 == run(*shlex.split(typed)[1:])
    as_happened = capsys.readouterr()

    assert 1 == code
    for text in (told.err, by_hour.err):
        assert "no door is in the map then" in text
        assert "recorded later, from 20" in text
        assert "(event 0)" in text
        assert f"type: {typed}." in text
    assert "front" in now.out
    assert now.out == as_happened.out
    assert "" == now.err
    for verb in (("replay", "log"), ("timeline", "log", "front"), ("export", "log", "doors.csv")):
        assert 1 == run(*verb, "--known-at", "2024-05-19")
        assert 'ask --at "2024-05-19 00:00:00+00:00" alone' in capsys.readouterr().err
        assert 0 == run(*verb, "--at", "2024-05-19")
        assert "recorded later" not in capsys.readouterr().err
    for verb in (("probabilities", "log", "front"), ("best-time", "log", "front")):
        assert 1 == run(*verb, "--known-at", "2024-05-19")
        assert '--at "2024-05-19 00:00:00+00:00" --as-happened' in capsys.readouterr().err
        assert 0 == run(*verb, "--at", "2024-05-19")
        assert 0 == run(*verb, "--known-at", "2024-05-19", "--as-happened")
        capsys.readouterr()


@pytest.mark.parametrize("more", [["--json"], ["--by", "week", "--json"], ["--apply", "--json"]])
def test_a_machine_is_told_too_that_nothing_was_known_then(
    folder: Path, capsys: pytest.CaptureFixture[str], more: list[str]
) -> None:
    """An empty list of doors, with exit code 0, would be taken for an answer."""
    assert 1 == run("probabilities", "log", "--at", "2026-01-01", *more)

    error = json.loads(capsys.readouterr().out)["error"]
    assert "UnknownDoorError" == error["kind"]
    assert "before 2026-03-0" in error["message"]


def test_a_door_of_which_nothing_was_told_later_is_not_said_to_be_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The hint is about the door that is asked for; by an event's number the same is found."""
    monkeypatch.chdir(tmp_path)
    clock = SteadyClock()
    with sl.create("log", tz="UTC", clock=clock) as log:
        log.add_door(name="side")
        log.add_door(name="front")
        log.observe("front", "open", at=log.event(2).happened_ns)

    for door, hints in (("front", 1), ("side", 0)):
        assert 0 == run("timeline", "log", door, "--known-at", "event:3"), door
        assert hints == capsys.readouterr().err.count("recorded later")


def test_who_asks_about_a_time_before_the_doors_were_added_is_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And what to do, if they were there."""
    monkeypatch.chdir(tmp_path)
    with sl.create("log", tz="UTC", clock=SteadyClock()) as log:
        log.add_door(name="front")
        with pytest.warns(EarlyEventsWarning):
            log.observe("front", "open", at="2026-02-01")

    assert 1 == run("probabilities", "log", "front", "--at", "2026-02-02")
    assert "log --since-ever" in capsys.readouterr().err
    assert 0 == run("import", "log", "--since-ever")
    assert 0 == run("probabilities", "log", "front", "--at", "2026-02-02")
