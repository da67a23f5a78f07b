"""`define`, `add --class`, and `--class` where it chooses what is told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import semmap_log as sl
from tests.verbs import Refuses


@pytest.fixture(autouse=True)
def office(log: sl.DoorLogWriter, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The log `office`, closed, in the working directory."""
    log.close()
    monkeypatch.chdir(path.parent)


def test_a_class_is_defined_and_its_objects_come(run_verb) -> None:
    assert 0 == run_verb("define", "office", "lift", "--states", "here,away", "--actor", "ann")[0]
    code, out, _ = run_verb(
        "add", "office", "--class", "lift", "--from", "0,5", "--to", "1,5", "--state", "here"
    )
    assert (0, "5\n") == (code, out)
    assert 0 == run_verb("observe", "office", "id:5", "away")[0]

    _, out, _ = run_verb("replay", "office", "--class", "lift", "--json")
    shown = json.loads(out)
    assert ["lift"] == [door["class"] for door in shown["doors"]]
    assert "away" == shown["doors"][0]["state_word"]
    assert {"name": "lift", "geometry": "segment", "states": ["here", "away"],
            "blocks": ["away"]} in shown["classes"]  # fmt: skip


def test_what_cannot_be_is_told_in_a_line(refuses: Refuses) -> None:
    refuses("""
        define office door
        define office a --states x
        define office a --geometry ball
        add office --class lift
        add office --class spill --outline 1,1
        add office --class spill --outline '1;1'
        add office --x 1
        observe office west shut
        update office west --state wet
        replay office --class lift
        history office west --class dock
        probabilities office west --class dock
        export office o.jsonl --class dock
        redact office --door west --key class
    """)


def test_a_class_chooses_what_is_told(run_verb) -> None:
    """Each verb tells of that class alone, and `door` means what is no other thing."""
    _, out, _ = run_verb("history", "office", "--class", "spill")
    assert {"4"} == {row.split("\t")[4] for row in out.splitlines()[1:]}
    _, out, _ = run_verb("probabilities", "office", "--class", "door", "--json")
    assert [1] == [door["door_id"] for door in json.loads(out)["doors"]]
    _, out, _ = run_verb("replay", "office", "--class", "door")
    assert ["1"] == [row.split("\t")[0] for row in out.splitlines()[1:]]
    for line in (
        "report office o.html --class dock",
        "view office --save o.rrd --class spill",
        "costmap office o.png --class spill",
        "export office o.csv --class dock",
    ):
        code, _, err = run_verb(*line.split())
        assert 0 == code, err
    assert "1 door" in run_verb("report", "office", "o.html", "--class", "dock")[2]


def test_tables_call_states_as_the_class_does(run_verb) -> None:
    """History, timeline, why, tail: what a person reads."""
    run_verb("observe", "office", "west", "taken", "--accuracy", "0.9")
    told = {
        "history office west": "seen taken (90%), was free",
        "tail office": "seen taken (90%)",
        "timeline office west": "\ttaken\t",
        "why office west --at now": "before that free",
        "replay office": "\tdock\ttaken\t",
        "show office 5": "west",
    }
    for line, words in told.items():
        code, out, err = run_verb(*line.split())
        assert (0, True) == (code, words in out), (line, out, err)


def test_info_counts_them_by_class(run_verb) -> None:
    _, out, _ = run_verb("info", "office")

    assert [["doors", "1"], ["class dock", "1"], ["class shutter", "1"], ["class spill", "1"]] == [
        row.split("\t") for row in out.splitlines() if row.startswith(("doors", "class "))
    ]
