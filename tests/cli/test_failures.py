"""With --json every verb answers with one document, whatever comes; without, with a line."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

import semmap_log as sl
from semmap_log.cli.app import app
from tests.verbs import Verb


@pytest.fixture
def run(run_verb: Verb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Verb:
    """Run a command line in a folder of its own, with a log; return exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(x=1, y=2, theta=0, width=0.9, name="front", state="closed")

    return run_verb


def test_every_verb_that_prints_has_json() -> None:
    """`serve` prints nothing on stdout, `help` only for people."""
    verbs = dict(get_command(app).commands)  # type: ignore[attr-defined]
    verbs |= verbs.pop("call").commands

    without = {
        name for name, verb in verbs.items()
        if "--json" not in {option for param in verb.params for option in param.opts}
    }  # fmt: skip

    assert {"serve", "help"} == without


@pytest.mark.parametrize(
    ("arguments", "kind", "code"),
    [
        (["replay", "nolog"], "NotALogError", 1),
        (["observe", "log", "back", "open"], "UnknownDoorError", 1),
        (["replay", "log", "--at", "noon-ish"], "MomentError", 1),
        (["replay", "log", "--when", "now"], "UsageError", 2),
        (["replay"], "UsageError", 2),
        (["reply", "log"], "UsageError", 2),
        (["export", "log", "x.odt"], "FormatError", 1),
        (["export", "log", "x.yaml", "--since", "now"], "UsageError", 2),
        (["report", "log", "x.odt"], "FormatError", 1),
        (["init", "log"], "LogExistsError", 1),
        (["import", "log", "none.csv"], "FormatError", 1),
        (["history", "log", "--kind", "DoorOpened"], "UsageError", 2),
    ],
)
def test_an_error_is_a_document(run: Verb, arguments: list[str], kind: str, code: int) -> None:
    """In the place of the answer, with what a person would be told, and nothing beside it."""
    ended, out, err = run(*arguments, "--json")
    told = run(*arguments)

    error = json.loads(out)["error"]
    assert (code, "") == (ended, err)
    assert (kind, code) == (error["kind"], error["exit_code"])
    assert (code, "") == told[:2]
    assert error["message"] in told[2]


def test_problems_of_a_file_are_counted_by_kind(run: Verb, tmp_path: Path) -> None:
    """Ten thousand bad rows are one entry."""
    rows = "".join(f"2026-01-01T00:00,front,opn{n}\n" for n in range(10_000))
    (tmp_path / "x.csv").write_text(f"timestamp,door,state\n{rows}")

    code, out, _ = run("import", "log", "x.csv", "--json")

    (problem,) = json.loads(out)["error"]["problems"]
    assert (1, 10_000, 10_001, [2, 3]) == (
        code, problem["count"], problem["last_line"], problem["lines"][:2]
    )  # fmt: skip
    assert "got 'opn0'" in problem["text"]


def test_an_error_in_the_middle_of_an_answer_is_on_stderr(
    run: Verb, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its last line: what is out already cannot become another document."""

    def broken(*_: object, **__: object) -> Any:
        yield from whole
        raise sl.SemmapError("damaged in its middle")

    whole = [sl.read("log").entry(0)]
    monkeypatch.setattr(sl.DoorLog, "history", broken)

    code, out, err = run("history", "log", "--json")

    assert 1 == code
    assert out.startswith("[\n{")
    assert "damaged in its middle" == json.loads(err.splitlines()[-1])["error"]["message"]


def test_json_as_a_value_is_no_option(run: Verb) -> None:
    """Behind `--` words are values."""
    code, out, err = run("annotate", "nolog", "--", "front", "name", "--json")

    assert (1, "") == (code, out)
    assert err.startswith("semmap-log: nolog")


def test_what_was_made_is_told_as_json(run: Verb) -> None:
    """Of verbs that write files, too."""
    _, exported, _ = run("export", "log", "x.jsonl", "--json")
    _, bag, _ = run("export", "log", "x.mcap", "--json")
    _, page, _ = run("report", "log", "x.html", "--json")
    _, made, _ = run("init", "new", "--tz", "Europe/Oslo", "--json")

    told = {"file": "x.jsonl", "wrote": "2 events", "left_out": [], "notes": []}
    assert told == json.loads(exported)
    assert 0 < json.loads(bag)["messages"]["/lta_semantic_map_door_db"]
    assert Path("x.html").stat().st_size == json.loads(page)["bytes"]
    assert ("new", "Europe/Oslo", None) == tuple(
        json.loads(made)[key] for key in ("log", "timezone", "floor_map")
    )


@pytest.mark.parametrize(
    "verb",
    [
        ["history", "log"],
        ["timeline", "log", "front"],
        ["report", "log", "x.html"],
        ["export", "log", "x.mcap"],
        ["costmap", "log", "x.mcap"],
        ["evaluate", "log"],
        ["diff", "log"],
    ],
    ids=str,
)
def test_ranges_of_time_have_one_name(run: Verb, verb: list[str]) -> None:
    """--since and --until, or both in one."""
    for names in (("--since", "--until"), ("--from", "--to")):
        code, _, err = run(*verb, names[0], "now", names[1], "1h ago")
        assert (1, True) == (code, "swap them" in err)
    code, _, err = run(*verb, "--since", "now..1h ago")
    assert 1 == code, err
    code, _, err = run(*verb, "--since", "1h ago..now", "--until", "now")
    assert 2 == code
    assert "names both ends" in err
    shown = run(verb[0], "--help")[1]
    assert "--since" in shown
    assert "--from" not in shown


def test_diff_takes_its_moments_in_either_way(run: Verb) -> None:
    """By their places, or as other verbs have them; not one of them twice, and the first always."""
    asked = [
        ["event:0", "event:1"], ["event:0..event:1"], ["--since", "event:0", "--until", "event:1"],
        ["event:0", "--until", "event:1"], ["--since", "event:0..event:1"], ["event:0"],
    ]  # fmt: skip
    answers = {run("diff", "log", *words, "--json")[1] for words in asked[:-1]}
    left_open = json.loads(run("diff", "log", *asked[-1], "--json")[1])
    (answer,) = answers

    assert json.loads(answer)["events"] == left_open["events"] != []
    for words, said in (
        ([], "expected the earlier moment"),
        (["--until", "now"], "expected the earlier moment"),
        (["event:0", "--since", "event:0"], "says that already"),
        (["event:0", "event:1", "--until", "now"], "says that already"),
        (["event:0..event:1", "event:1"], "leave T2 out"),
    ):
        code, out, err = run("diff", "log", *words)
        assert (2, "", True) == (code, out, said in err), err


@pytest.mark.parametrize("typed", ["--form", "--frm", "--t", "--from-", "--too"])
def test_no_old_spelling_is_offered_for_one_that_is_none(typed: str, run: Verb) -> None:
    """Help does not know them; what is offered, it does."""
    _, _, err = run("evaluate", "log", typed, "1")
    assert "No such option" in err
    assert set() == {"--from", "--to"} & set(re.findall(r"--[a-z]+", err.partition("options")[2]))
    assert "--since" in run("history", "log", "--sinc", "1")[2]
    assert "--from" in run("add", "log", "--form", "1,2")[2]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("replya", " Did you mean replay or play?\n"), ("stat", "\n"), ("xyzzy", "\n")],
)
def test_of_a_verb_that_is_none_one_that_is_shown_is_offered(
    typed: str, meant: str, run: Verb
) -> None:
    """Not the hidden names of old: `state`, `log`."""
    code, out, err = run(typed, "log")

    assert (2, "") == (code, out)
    assert f"No such command '{typed}'.{meant}" in err
    assert "state" not in err


def test_when_it_happened_is_no_event(run: Verb) -> None:
    """What is expected, and where the event's time stands."""
    code, _, err = run("observe", "log", "front", "open", "--at", "event:0")

    assert 1 == code
    assert "expected when it happened, a time such as 2026-" in err
    assert "got the number of event 0" in err


def test_from_and_to_are_places(run: Verb) -> None:
    """Where a door is added."""
    code, out, _ = run("add", "log", "--from", "1,2", "--to", "1.9,2")

    assert (0, "2\n") == (code, out)
