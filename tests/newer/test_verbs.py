"""Every verb is asked about logs that a later version of this program has written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.main import get_command

from semmap_log.cli import main
from semmap_log.cli.app import app
from semmap_log.log.replay.maintenance import verify
from tests.newer.logs import UNKNOWN, NewerLogs
from tests.store.logs import segment_files

LIST = {
    "history": ["LOG"],
    "tail": ["LOG"],
    "show": ["LOG", str(UNKNOWN)],
    "info": ["LOG"],
    "verify": ["LOG"],
}
"""They list what there is, and tell what it is called."""
ANSWER = {
    "replay": ["LOG"],
    "diff": ["LOG", "@0..@1"],
    "timeline": ["LOG", "front"],
    "why": ["LOG", "front"],
    "sql": ["LOG", "select * from doors"],
    "probabilities": ["LOG"],
    "best-time": ["LOG", "front"],
    "patrol-plan": ["LOG"],
    "go": ["LOG", "1,1", "2,2"],
    "evaluate": ["LOG"],
    "calibrate": ["LOG", "--truth", "TRUTH.csv"],
    "export": ["LOG", "OUT.jsonl"],
    "costmap": ["LOG", "OUT.png"],
    "rooms": ["LOG"],
    "report": ["LOG", "OUT.html"],
    "view": ["LOG", "--save", "OUT.rrd"],
}
"""What they say follows from all events."""
EXPORTS = ("yaml", "csv", "parquet", "html", "bag", "pgm", "mcap", "rrd")
WRITE = {
    "import": ["LOG", "TRUTH.jsonl"],
    "add": ["LOG", "--x", "1", "--y", "1", "--theta", "0", "--width", "1"],
    "update": ["LOG", "front", "--state", "open"],
    "remove": ["LOG", "front"],
    "observe": ["LOG", "front", "open"],
    "annotate": ["LOG", "front", "key", "value"],
    "retract": ["LOG", "2"],
    "rebase": ["LOG", "MAP.yaml", "--by", "1,0,0"],
    "define": ["LOG", "dock"],
    "patrol": ["LOG", "start"],
    "record": ["LOG"],
}
OF_NO_LOG = {"help", "demo", "init", "ros-package", "prolog-module", "oprs-package", "ask", "call"}
NEED_MORE = {"serve", "play", "scan-report"}
"""ROS, or scans; they open the log as `append` and `read` do."""
IN_PLACE = {
    "copy": ["LOG", "COPY"],
    "recover": ["LOG", "--yes"],
    "compact": ["LOG"],
    "redact": ["LOG", "--tracks"],
    "retain": ["LOG", "--keep", "1d"],
    "pin": ["LOG", "audit"],
    "index": ["LOG"],
}
CARE = set(IN_PLACE)
"""`test_care`, `test_read_model`."""
STORES = {"ship", "fetch", "fleet"}
"""`tests/fleet`: a store knows no kinds of events."""
SIGNS = {"sign"}
"""`test_care`: the place of an unknown kind is signed as that of any other."""
JOINS = {"join"}
"""`tests/fleet/join`: what is unknown in one of the logs."""


def test_every_verb_is_asked() -> None:
    """A verb that comes has to be put into one of the tables here."""
    command = get_command(app)
    verbs = {name for name, one in command.commands.items() if not one.hidden}  # type: ignore[attr-defined]

    assert verbs == {*LIST, *ANSWER, *WRITE, *OF_NO_LOG, *NEED_MORE, *CARE, *STORES, *JOINS, *SIGNS}


@pytest.mark.parametrize("made", ["locked live", "locked closed", "replaced live", "unsaid live"])
@pytest.mark.parametrize("verb", LIST)
def test_lists_show_what_is_unknown(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, made: str
) -> None:
    """Under its own name, and with the later events, too."""
    name, how = made.split()
    kind = "DoorAddedV2" if name == "replaced" else "DoorLocked"
    log = newer.log(name, tmp_path, how=how)

    said = _ask(capsys, log, verb, LIST[verb])

    assert (said.code, kind in said.out, "Traceback" in said.err) == (0, True, False)


@pytest.mark.parametrize("verb", ["history", "tail", "show"])
def test_json_has_the_bytes(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """Nothing of an event is swallowed, though nobody here knows its fields."""
    log = newer.log("locked", tmp_path)

    said = _ask(capsys, log, verb, [*LIST[verb], "--json"])

    found = [json.loads(line) for line in said.out.splitlines()] if verb == "tail" else []
    found = found or json.loads(said.out)
    one = found[UNKNOWN] if isinstance(found, list) else found
    assert one["kind"] == "DoorLocked"
    assert one["newer"] is True
    assert one["cdr_base64"].startswith("AAEAAAEAAAA")  # CDR's head, then the door's id


def test_a_door_s_history_has_what_may_be_about_it(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Which door an event is about is not known either."""
    log = newer.log("locked", tmp_path)

    assert "DoorLocked" in _ask(capsys, log, "history", ["LOG", "front"]).out
    assert "DoorLocked" in _ask(capsys, log, "tail", ["LOG", "--door", "front"]).out


@pytest.mark.parametrize("name", ["locked", "replaced", "unsaid"])
@pytest.mark.parametrize("verb", {**ANSWER, **WRITE})
def test_what_may_be_touched_is_refused(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, name: str
) -> None:
    """It is no damage, and it is not written: what to do is to install the newer version."""
    log = newer.log(name, tmp_path)
    before = _bytes_of(log)

    said = _ask(capsys, log, verb, {**ANSWER, **WRITE}[verb])

    assert said.code == 1
    assert "written by a newer version of semmap-log" in said.err
    assert "install the newer version" in said.err
    assert "take the folder from a backup" not in said.err
    assert _bytes_of(log) == before
    assert list(tmp_path.glob("OUT*")) == []


@pytest.mark.parametrize("ending", EXPORTS)
def test_no_export_leaves_events_out_in_silence(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str
) -> None:
    """A file for other programs would be taken for the whole."""
    log = newer.log("locked", tmp_path)

    said = _ask(capsys, log, "export", ["LOG", f"OUT.{ending}"])

    assert (said.code, "DoorLocked" in said.err) == (1, True)
    assert list(tmp_path.glob("OUT*")) == []


@pytest.mark.parametrize("verb", ANSWER)
def test_what_is_marked_is_left_out_and_said(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """The later version promises that the answer is the same."""
    log = newer.log("weighed", tmp_path)

    said = _ask(capsys, log, verb, ANSWER[verb])

    assert "written by a newer version" not in said.err
    assert "1 DoorWeighed" in said.err


@pytest.mark.parametrize("name", ["entry", "minor"])
@pytest.mark.parametrize("verb", {**LIST, **ANSWER})
def test_a_later_version_that_added_no_kind_is_read_as_ever(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, name: str
) -> None:
    """As a log of our own with the same events is."""
    own = newer.log("minor", tmp_path / "own")
    for path in segment_files(own):
        assert b"format_minor" in path.read_bytes()
    log = newer.log(name, tmp_path / "asked")

    said = _ask(capsys, log, verb, {**LIST, **ANSWER}[verb])

    assert "newer version of semmap-log has written" not in said.err
    assert "damaged" not in said.err
    assert verify(log).exit_code == 0


@pytest.mark.parametrize("verb", {**LIST, **ANSWER, **WRITE, **IN_PLACE})
def test_another_major_version_is_told_by_every_verb(
    newer: NewerLogs, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """Nothing of it is understood, and nothing is damaged."""
    log = newer.log("major", tmp_path)
    before = _bytes_of(log)
    arguments = {**LIST, **ANSWER, **WRITE, **IN_PLACE}

    said = _ask(capsys, log, verb, arguments[verb])

    assert said.code == 1
    assert "format version '5'" in said.err
    assert "install a newer semmap-log" in said.err
    assert "damaged" not in said.err
    assert _bytes_of(log) == before


class _Said:
    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err


def _ask(capsys: pytest.CaptureFixture[str], log: Path, verb: str, arguments: list[str]) -> _Said:
    folder = log.parent
    said = {
        "TRUTH.csv": "timestamp,door,state\n2026-01-01T12:00:00Z,front,open\n",
        "TRUTH.jsonl": '{"kind": "DoorObserved", "door_id": 1, "state": "OPEN"}\n',
        "MAP.pgm": "P2 2 2 255 254 254 254 254\n",
        "MAP.yaml": "image: MAP.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.2\n",
    }
    for name, text in said.items():
        (folder / name).write_text(text, encoding="utf-8")
    named = {"LOG": str(log), **{name: str(folder / name) for name in said}}
    given = [
        str(folder / one) if one.startswith("OUT") else named.get(one, one) for one in arguments
    ]
    capsys.readouterr()
    code = 0
    try:
        main([verb, *given])
    except SystemExit as end:
        code = int(end.code or 0)
    out, err = capsys.readouterr()
    return _Said(code, out, err)


def _bytes_of(log: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in log.iterdir() if path.name != ".lock"}
