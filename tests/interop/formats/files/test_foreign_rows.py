"""Door logs of other systems, in their published forms, and as a command line describes them."""

from __future__ import annotations

import gzip
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.core.model.moments import format_utc
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.formats.files.door_table import PRESETS, form_of
from semmap_log.interop.importing.importing import ImportOptions, import_file

HOME_ASSISTANT = """entity_id,state,last_changed
binary_sensor.front_door,off,2026-03-01T10:00:00.000Z
binary_sensor.front_door,on,2026-03-01T11:00:00.123Z
sensor.temperature,21.5,2026-03-01T11:00:00.200Z
cover.garage,opening,2026-03-01T11:30:00.000Z
binary_sensor.front_door,unavailable,2026-03-01T12:00:00.000Z
"""
ZIGBEE2MQTT = """[2026-03-01 10:00:00] info: \tz2m:mqtt: MQTT publish: topic \
'zigbee2mqtt/back gate', payload '{"battery":100,"contact":false,"linkquality":212,"voltage":3000}'
[2026-03-01 10:30:00] info: \tz2m: Connected to MQTT server
Nov 26 09:55:20 hub npm[4051]: Zigbee2MQTT:info  2026-03-01 11:00:00: MQTT publish: topic \
'zigbee2mqtt/back gate', payload '{"contact":true,"update":{"state":"idle"}}'
info  2026-03-01 11:30:00: MQTT publish: topic 'zigbee2mqtt/lamp', payload '{"state":"ON"}'
2026-03-01T13:00:00+0100 zigbee2mqtt/house/shed {"linkquality":23,"contact":false}
""".replace("\\\n", "")
CASAS = """2026-03-01 10:00:00.055202\tM046\tON
2026-03-01 10:00:02.036689   D001    OPEN
2026-03-01 10:00:08.053264 D001 CLOSE Leave_Home begin
2026-03-01 10:00:09.5\tP001\t1077.3
2026-03-01 10:00:10 FrontDoor OPEN
"""


def _read(path: Path, text: str, **told: Any) -> list[tuple[str, str, str]]:
    """Return (time, door, state) of each row."""
    path.write_text(text)
    found = read_door_csv(path, tz="UTC", form=form_of(**told))
    return [(format_utc(row.happened_ns)[11:23], row.door, row.state.name) for row in found]


def test_a_history_of_home_assistant(tmp_path: Path) -> None:
    """What its history panel downloads; other entities are left out, and named."""
    door = "binary_sensor.front_door"
    rows = _read(tmp_path / "history.csv", HOME_ASSISTANT, preset="home-assistant")

    assert [
        ("10:00:00.000", door, "CLOSED"), ("11:00:00.123", door, "OPEN"),
        ("11:30:00.000", "cover.garage", "MOVING"), ("12:00:00.000", door, "OFFLINE"),
    ] == rows  # fmt: skip
    form = form_of(preset="home-assistant", only=["binary_sensor.*door*"])
    found = read_door_csv(tmp_path / "history.csv", tz="UTC", form=form)
    assert (door,) == found.doors
    (left_out,) = found.left_out
    assert "rows: 2, of what --only does not name: 'sensor.temperature', 'cover.garage'" == left_out


def test_the_same_in_words(tmp_path: Path) -> None:
    """As the preset has it, but told by the options."""
    told = {"columns": "time=last_changed, door=entity_id,state=state",
            "states": "on=open,OFF=closed", "only": ["binary_sensor.*door*"]}  # fmt: skip
    rows = _read(tmp_path / "history.csv", HOME_ASSISTANT, **told)

    assert ["CLOSED", "OPEN", "OFFLINE"] == [state for _, _, state in rows]


def test_a_log_of_zigbee2mqtt(tmp_path: Path) -> None:
    """Of two of its versions, of a journal, and of mosquitto_sub."""
    rows = _read(tmp_path / "log.log", ZIGBEE2MQTT, preset="zigbee2mqtt")

    assert [
        ("10:00:00.000", "back gate", "OPEN"), ("11:00:00.000", "back gate", "CLOSED"),
        ("12:00:00.000", "house/shed", "OPEN"),
    ] == rows  # fmt: skip


@pytest.mark.parametrize("preset", ["zigbee2mqtt", "casas"])
def test_lines_that_nobody_would_write_cost_little(tmp_path: Path, preset: str) -> None:
    """Times, topics and words again and again, and no message behind them."""
    line = "2026-03-01 10:00:00 zigbee2mqtt/a '" * 1800
    (tmp_path / "a").write_text(f'{line}\n{line} {{\n{line}{{"contact": \n' * 100)

    found = read_door_csv(tmp_path / "a", tz="UTC", form=form_of(preset=preset))

    assert 0 == len(found)


def test_a_data_set_of_casas(tmp_path: Path) -> None:
    """Tabs or blanks, with activities or without: its doors."""
    rows = _read(tmp_path / "data", CASAS, preset="casas")

    assert [
        ("10:00:02.036", "D001", "OPEN"), ("10:00:08.053", "D001", "CLOSED"),
        ("10:00:10.000", "FrontDoor", "OPEN"),
    ] == rows  # fmt: skip


@pytest.mark.parametrize("separator", [";", "\t", "|", ","])
@pytest.mark.parametrize(
    ("unit", "number"),
    [("s", "1772359200.5"), ("ms", "1772359200500"), ("us", "1772359200500000"),
     ("ns", "1772359200500000000"), ("ms", "1.7723592005e12"), (None, "@1772359200.5"),
     (None, "2026-03-01T10:00:00.5")],
)  # fmt: skip
def test_numbers_of_a_stated_unit(tmp_path: Path, unit: Any, number: str, separator: str) -> None:
    """Whatever parts the cells; with True and 1."""
    text = f"when;which;shut?;x\n{number}; gate ;True;\n{number};lab;0;7\n"
    rows = _read(
        tmp_path / "a.csv", text.replace(";", separator), unit=unit,
        columns="time=when,door=which,state=shut?", states="true=closed,1=closed,0=open",
    )  # fmt: skip

    assert [("10:00:00.500", "gate", "CLOSED"), ("10:00:00.500", "lab", "OPEN")] == rows


def test_days_with_points_and_decimal_commas_as_spreadsheets_write_them(tmp_path: Path) -> None:
    """Day, month, year; a comma is no decimal point where it parts the cells."""
    path = tmp_path / "a.csv"
    told = {"columns": "time=Zeit,door=Tür,state=Zustand,accuracy=Güte", "states": "zu=closed"}
    text = "\ufeffZeit;Tür;Zustand;Güte\r\n02.03.2026 14:02;Büro;zu;0,9\r\n3.3.2026;Büro;open;\r\n"
    path.write_text(text, encoding="utf-8")

    rows = list(read_door_csv(path, tz="UTC", form=form_of(**told)))

    times = [format_utc(row.happened_ns)[:16] for row in rows]
    assert ["2026-03-02T14:02", "2026-03-03T00:00"] == times
    assert [0.9, True] == [rows[0].accuracy, math.isnan(rows[1].accuracy)]
    path.write_text(text.replace(";0,9", ",0,9").replace(";", ","), encoding="utf-8")
    with pytest.raises(FormatError, match=r"number from 0\.5 to 1"):
        read_door_csv(path, tz="UTC", form=form_of(**told))


def test_semicolons_need_no_options(tmp_path: Path) -> None:
    """Packed or not; accuracies are read."""
    text = "door;timestamp;state;accuracy\ngate;2026-03-01T10:00;open;0.9\n"
    (tmp_path / "a.csv").write_bytes(gzip.compress(text.encode()))

    (row,) = read_door_csv(tmp_path / "a.csv", tz="UTC")

    assert ("gate", "OPEN", 0.9) == (row.door, row.state.name, row.accuracy)


@pytest.mark.parametrize(
    ("text", "told", "message"),
    [
        ("a,b\n1,2\n", {"columns": "time=a,door=b,state=c"}, "expected the columns c, got 'a,b'"),
        ("a,b,c\n1\n", {"columns": "time=a,door=b,state=c"}, ":2: expected 3 cells .*, got 1"),
        ("timestamp,door,state\n@1,a,ajar\n", {"only": ["a"]}, "--states says what another word"),
        ("timestamp,door,state\nsoon,a,open\n", {"unit": "ms"}, "Expected a time such as"),
        ("timestamp,door,state\nNaN,a,open\n", {"unit": "ms"}, "Expected a time such as"),
        ("timestamp,door,state\n1e999,a,open\n", {"unit": "ms"}, "Expected a time such as"),
        ("entity_id,state\n", {}, "of another system's: --columns, or --preset"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(
    tmp_path: Path, text: str, told: dict[str, Any], message: str
) -> None:
    """And with the option that may help."""
    with pytest.raises(FormatError, match=message):
        _read(tmp_path / "a.csv", text, **told)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"columns": "time=a"}, "expected time, door and state, got none for door, state"),
        ({"columns": "time=a,door=b,state=c,width=d"}, "--columns: expected .*, got width"),
        ({"columns": "time"}, "--columns: expected a=b,c=d with each a once, got 'time'"),
        ({"states": "on=ajar"}, "--states: expected one of UNKNOWN OPEN"),
        ({"states": "on=open,on=closed"}, "--states: expected a=b,c=d with each a once"),
    ],
)
def test_what_no_form_is_is_said(told: dict[str, Any], message: str) -> None:
    """Before any file is read."""
    with pytest.raises(CommandError, match=message):
        form_of(**told)


def _run(*words: str) -> object:
    with pytest.raises(SystemExit) as left:
        main(list(words))
    return left.value.code


def test_the_verb_takes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever a file is called; the same file in the same form is known."""
    log, path = tmp_path / "log", tmp_path / "history.jsonl"
    sl.create(log, tz="UTC").close()
    path.write_text(HOME_ASSISTANT)
    words = ["import", str(log), str(path), "--preset", "home-assistant", "--only", "binary*door*"]

    assert 1 == _run(*words[:3], "--columns", "time=last_changed")
    assert [0, 0] == [_run(*words), _run(*words)]
    out, err = capsys.readouterr()
    assert "rows: 3" in out
    assert "imported before; nothing to do" in out
    assert "rows: 2, of what --only" in err
    assert 2 == _run(*words[:3], "--propose-doors", "--scan", "--yes", "--only", "x")
    assert 1 == _run(*words[:-1], "nothing*", "--dry-run")
    assert "rows: 5" in capsys.readouterr().err


@pytest.mark.parametrize("preset", PRESETS)
def test_python_takes_them(tmp_path: Path, preset: str) -> None:
    """As a form among the options."""
    texts = {"home-assistant": HOME_ASSISTANT, "zigbee2mqtt": ZIGBEE2MQTT, "casas": CASAS}
    path = tmp_path / "file"
    path.write_text(texts[preset])
    with sl.create(tmp_path / "log", tz="UTC") as log:
        import_file(log, path, ImportOptions(form=PRESETS[preset]))

        assert 2 == len(_names(log))


def _names(log: sl.DoorLog) -> Sequence[str | None]:
    return [door.name for door in log.replay().doors.values()]
