"""`semmap-log join` and the verbs that are asked about what it makes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from tests.fleet.join.some_robots import START_NS, SetClock, a_robot, doors_of, two_robots
from tests.verbs import Refuses, ran


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with the logs `tug1` and `tug2` in it."""
    monkeypatch.chdir(tmp_path)
    two_robots(tmp_path)
    return tmp_path


def test_each_verb_that_reads_takes_a_join(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As it takes a log; none writes anything beside it."""
    assert 0 == ran(capsys, "join", "x.join.json", "tug1", "tug2")[0]
    for verb, *more in (
        ["replay"], ["history", "front"], ["timeline", "front"], ["probabilities"], ["info"],
        ["tail"], ["diff", "event:0..now"], ["export", "o.csv"], ["report", "o.html"],
        ["view", "--save", "o.rrd"], ["show", "0"], ["verify"], ["costmap", "o.png"],
    ):  # fmt: skip
        code, out, err = ran(capsys, verb, "x.join.json", *more)
        assert (0, False) == (code, "Traceback" in err), (verb, err)

    code, out, _ = ran(capsys, "history", "x.join.json", "front")
    assert "tug2/camera" in out
    assert "tug1" in out
    assert "verify" not in ran(capsys, "info", "x.join.json")[2]


@pytest.mark.parametrize(
    "line",
    [
        "observe x.join.json front open",
        "add x.join.json --x 1 --y 1 --theta 0 --width 1",
        "compact x.join.json",
        "recover x.join.json",
        "retract x.join.json 1",
        "ship x.join.json s3://bucket/x",
        "record x.join.json",
    ],
)
def test_no_verb_writes_to_a_join(
    line: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each says what to do instead."""
    ran(capsys, "join", "x.join.json", "tug1", "tug2")

    code, _, err = ran(capsys, *line.split())

    assert 0 != code
    assert "a join of logs can only be read" in err
    assert "semmap-log join x.join.json --write NEW" in err


def test_the_definition_moves_with_its_logs(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Paths in it are relative to it."""
    ran(capsys, "join", "x.join.json", "tug1", "tug2", "--frame", "tug2=1,2,3")
    said = json.loads((here / "x.join.json").read_text(encoding="utf-8"))
    before = repr(sl.read("x.join.json").replay())
    moved = here.rename(here.with_name(f"{here.name}-moved"))
    monkeypatch.chdir(moved.parent)

    assert ["tug1", "tug2"] == sorted(log["log"] for log in said["logs"])
    assert [1.0, 2.0, 3.0] == next(log for log in said["logs"] if log["name"] == "tug2")["frame"]
    assert before == repr(sl.read(moved / "x.join.json").replay())


def test_another_log_in_the_place_of_one_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its doors would take the place of another robot's."""
    ran(capsys, "join", "x.join.json", "tug1", "tug2")
    (here / "tug1").rename(here / "old")
    sl.create("tug1").close()

    code, _, err = ran(capsys, "replay", "x.join.json")

    assert 1 == code
    assert "the log was replaced by another one" in err


def test_proposals_are_printed_and_never_applied(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Either end of a door may be its start; what is written is a table for --doors."""
    with sl.append("tug2", clock=SetClock(START_NS + 40 * 10**9)) as log:
        log.add_door(x=5.95, y=2.1, theta=3.14159265, width=0.9, name="lager")
    line = ["join", "x.join.json", "tug1", "tug2", "--frame", "tug2=0,0,0"]

    code, out, _ = ran(capsys, *line, "--propose", "--write-doors", "m.csv")

    assert 0 == code
    assert "tug1 store\ttug2 lager\t0.11" in out
    assert not (here / "x.join.json").exists()
    assert "log,door,building door\ntug1,id:2,store\ntug2,id:3,store\n" == (
        here / "m.csv"
    ).read_text(encoding="utf-8")
    assert 0 == ran(capsys, *line, "--doors", "m.csv")[0]
    assert ["front", "store", "tug2/depot"] == sorted(doors_of(sl.read("x.join.json")))
    assert 1 == ran(capsys, *line, "--propose", "--write-doors", "m.csv")[0]


def test_conflicts_are_listed(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Geometry beyond a tolerance, another type, and that one removed it."""
    for name, kind in (("tug1", "hinged"), ("tug2", "sliding")):
        with sl.append(name, clock=SetClock(START_NS + 50 * 10**9)) as log:
            log.annotate("front", "type", kind)
    line = ["join", "x.join.json", "tug1", "tug2", "--frame", "tug2=0,0,0", "--json"]

    first = json.loads(ran(capsys, *line)[1])["conflicts"]
    with sl.append("tug2", clock=SetClock(START_NS + 60 * 10**9)) as log:
        log.remove_door("front")
    second = json.loads(ran(capsys, *line)[1])["conflicts"]

    assert ["type", "geometry"] == [each["what"] for each in first]
    assert ["tug1: hinged", "tug2: sliding"] == first[0]["says"]
    assert "removed" in [each["what"] for each in second]
    assert "1.00 m apart" in first[1]["says"][0]


def test_what_cannot_be_meant_is_refused(here: Path, refuses: Refuses) -> None:
    """No file is left behind."""
    refuses("""
        join x.join.json tug1 tug2 --frame tug2=1,2
        join x.join.json tug1 tug2 --frame tug2=1,2,nan
        join x.join.json tug1 tug2 --frame tug9=1,2,3
        join x.join.json tug1 tug2 --frame tug2=1,2,3 --frame tug2=1,2,4
        join x.join.json tug1 tug2 --reference tug9
        join x.join.json tug1 tug2 --doors missing.csv
        join x.join.json tug1 tug2 missing
    """)

    assert not (here / "x.join.json").exists()


def test_a_join_written_out_is_a_log_of_its_own(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its notes say from which event of which log; it is good, and goes on."""
    code, _, err = ran(capsys, "join", "x.join.json", "tug1", "tug2", "--write", "new")
    with sl.append("tug1") as log:
        log_id, head = log.info.log_id, log.find_commit(0).hash.hex()  # type: ignore[union-attr]

    assert 0 == code
    assert "1 DoorAdded" in err
    assert f"log {log_id} event 0 head {head}" in ran(capsys, "show", "new", "0")[1]
    assert repr(sl.read("new").replay()) == repr(sl.read("x.join.json").replay())
    assert 0 == ran(capsys, "observe", "new", "front", "open")[0]
    assert 0 == ran(capsys, "verify", "new")[0]
    assert 1 == ran(capsys, "join", "x.join.json", "--write", "new")[0]


def test_verify_tells_of_each_log(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The join is as good as the worst of them."""
    ran(capsys, "join", "x.join.json", "tug1", "tug2")
    code, out, _ = ran(capsys, "verify", "x.join.json")
    (segment,) = (here / "tug2").glob("*.mcap")
    data = bytearray(segment.read_bytes())
    data[len(data) // 2] ^= 0xFF
    segment.write_bytes(data)

    assert (0, 2) == (code, out.count(": good; "))
    assert 4 == ran(capsys, "verify", "x.join.json")[0]
    assert 2 == ran(capsys, "verify", "x.join.json", "--head", "00" * 32)[0]


def test_a_join_is_no_part_of_itself(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nor is another file taken for one."""
    told = {"format": "semmap-log join", "version": 1, "logs": [{"log": "x.join.json"}]}
    (here / "x.join.json").write_text(json.dumps(told), encoding="utf-8")
    (here / "y.join.json").write_text('{"format": "other"}', encoding="utf-8")
    (here / "z.join.json").write_text(json.dumps(told | {"version": 2}), encoding="utf-8")

    assert "part of itself" in ran(capsys, "replay", "x.join.json")[2]
    assert "got another file" in ran(capsys, "replay", "y.join.json")[2]
    assert "install a newer semmap-log" in ran(capsys, "replay", "z.join.json")[2]
    assert "semmap-log join no.join.json LOG LOG" in ran(capsys, "replay", "no.join.json")[2]


def test_one_log_of_a_join_needs_no_name(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Robots of one name are told apart by their folders."""
    with a_robot(here / "spare", robot="tug1", clock=SetClock(START_NS + 1)) as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0, name="yard")

    said = json.loads(ran(capsys, "join", "x.join.json", "tug1", "spare", "--json")[1])

    assert {"spare", "tug1"} == {log["log"] for log in said["logs"]}
