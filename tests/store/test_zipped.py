"""A log in a zip file: read as it is, bounded, and never written to."""

from __future__ import annotations

import gc
import struct
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.errors import LogAccessError, LogError, NotALogError
from semmap_log.log.replay.care import plan_recovery, recover, verify
from semmap_log.store import zipped
from semmap_log.store.zipped import FREE_BYTES, MOST_LIST_BYTES, MOST_RATIO
from tests.store.logs import answers, segment_files

RECORDING = Path(__file__).parents[2] / "recordings" / "office"


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where zip files are unpacked: a folder of the test's own."""
    folder = tmp_path / "unpacked"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def _zip(path: Path, members: dict[str, bytes], how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as packed:
        for name, data in members.items():
            packed.writestr(name, data)
    return path


def _office(folder: str = "office/") -> dict[str, bytes]:
    return {f"{folder}{one.name}": one.read_bytes() for one in RECORDING.iterdir()}


@pytest.mark.parametrize("how", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize("folder", ["office/", "", "robots/2026/office/"])
def test_it_says_what_the_folder_says(tmp_path: Path, how: int, folder: str) -> None:
    """However it was packed: with its folder, without it, or deep in another."""
    path = _zip(tmp_path / "office.zip", _office(folder), how)

    assert answers(path) == answers(RECORDING)
    assert verify(path).head == verify(RECORDING).head


@pytest.mark.slow
def test_it_is_unpacked_once_and_goes_with_its_last_reader(tmp_path: Path, temporary: Path) -> None:
    """Nothing is left among the temporary files."""
    path = _zip(tmp_path / "office.zip", _office())

    log, other = sl.read(path), sl.read(path)

    assert len(list(temporary.iterdir())) == 1
    assert log.path == path
    del log
    gc.collect()
    assert len(other.replay()) > 0
    del other
    gc.collect()
    assert list(temporary.iterdir()) == []


def test_another_zip_of_that_name_is_unpacked_anew(tmp_path: Path) -> None:
    """What was read before stays what it was."""
    path = _zip(tmp_path / "office.zip", _office())
    log = sl.read(path)
    with sl.create(tmp_path / "other", tz="UTC") as made:
        made.add_door(x=0, y=0, theta=0, width=1)
    _zip(path, {f"other/{one.name}": one.read_bytes() for one in (tmp_path / "other").iterdir()})

    assert len(sl.read(path).replay()) == 1
    assert len(log.replay()) > 1


READING: dict[str, list[str]] = {
    "replay": [], "history": [], "tail": [], "show": ["3"], "diff": ["12:00..19:30"],
    "timeline": ["main_door"], "probabilities": [], "best-time": ["main_door"], "info": [],
    "verify": [], "export": ["OUT.jsonl"], "costmap": ["OUT.png"], "report": ["OUT.html"],
    "view": ["--save", "OUT.rrd"],
}  # fmt: skip


@pytest.mark.parametrize("verb", READING)
def test_every_reading_verb_takes_it(
    tmp_path: Path, temporary: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """And says the same on its output, but for the log's name."""
    path = _zip(tmp_path / "office.zip", _office())
    said = {}
    for log in (path, RECORDING):
        more = [one.replace("OUT", str(tmp_path / log.stem)) for one in READING[verb]]
        _main(verb, str(log), *more)
        said[log] = capsys.readouterr().out.replace(str(log), "LOG").split()  # lines may be folded

    assert said[path] == said[RECORDING]
    gc.collect()
    assert list(temporary.iterdir()) == []


WRITING: dict[str, list[str]] = {
    "import": ["FILE"], "update": ["1", "--state", "open"], "remove": ["1"],
    "add": ["--x", "1", "--y", "1", "--theta", "0", "--width", "1"],
    "observe": ["1", "open"], "annotate": ["1", "key", "value"], "retract": ["1"],
    "patrol": ["start"], "record": [], "recover": [], "compact": ["--dry-run"],
    "probabilities": ["--apply"], "redact": ["--notes"], "retain": ["--keep", "1d"], "pin": ["x"],
    "define": ["dock"],
}  # fmt: skip


@pytest.mark.parametrize("verb", WRITING)
def test_every_writing_verb_says_that_it_is_read_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """With what to do about it; the zip stays as it was."""
    path = _zip(tmp_path / "of fice.zip", _office())
    before = path.read_bytes()
    lines = tmp_path / "lines.jsonl"
    lines.write_text('{"kind": "DoorObserved", "door_id": 1, "state": "OPEN"}\n')

    code = _main(verb, str(path), *(str(lines) if one == "FILE" else one for one in WRITING[verb]))

    assert code == 1
    said = capsys.readouterr().err
    assert "a log in a zip file can only be read" in said
    assert f"unzip '{path}'" in said
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "write", [sl.append, recover, plan_recovery], ids=lambda write: write.__name__
)
def test_nothing_is_unpacked_to_refuse_a_writer(
    tmp_path: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch, write: Callable[[Path], Any]
) -> None:
    """It is known before."""
    path = _zip(tmp_path / "office.zip", _office())
    monkeypatch.setattr(zipped, "_unpack", None)

    with pytest.raises(LogAccessError, match="can only be read"):
        write(path)

    assert list(temporary.iterdir()) == []


def test_recovered_files_in_the_log_s_folder_are_no_second_log(tmp_path: Path) -> None:
    """Nor are what macOS and editors put beside the files."""
    more = {
        "office/damaged-1/office_000000.mcap": b"damaged",
        "__MACOSX/office/._office_000000.mcap": b"Mac",
        "notes.txt": b"hello",
        "office/.lock": b"",
    }

    assert answers(_zip(tmp_path / "office.zip", _office() | more)) == answers(RECORDING)


@pytest.mark.parametrize(
    ("members", "problem"),
    [
        ({}, "no log in this zip file"),
        ({"readme.txt": b"hello"}, "no log in this zip file"),
        ({**_office(), **_office("garage/")}, "expected one log in a zip file, got 2: garage, off"),
    ],
    ids=["empty", "none", "two"],
)  # fmt: skip
def test_it_must_hold_one_log(tmp_path: Path, members: dict[str, bytes], problem: str) -> None:
    """The message tells what there is."""
    path = _zip(tmp_path / "office.zip", members)

    with pytest.raises(NotALogError, match=problem):
        sl.read(path)


@pytest.mark.parametrize(
    "name",
    ["../office_000001.mcap", "/tmp/office_000001.mcap", "office/../../a.mcap", "C:/a.mcap",
     "office\\..\\a.mcap", "../../etc/passwd"],
)  # fmt: skip
def test_names_that_lead_out_are_refused(tmp_path: Path, temporary: Path, name: str) -> None:
    """Nothing is unpacked of a zip that tries."""
    path = _zip(tmp_path / "office.zip", _office() | {name: b"there"})

    with pytest.raises(LogError, match="leads out of it"):
        sl.read(path)

    assert list(temporary.iterdir()) == []


def test_a_link_is_no_segment(tmp_path: Path) -> None:
    """What a zip calls a link is refused by its kind."""
    path = tmp_path / "office.zip"
    link = zipfile.ZipInfo("office/office_000009.mcap")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(path, "w") as packed:
        for name, data in _office().items():
            packed.writestr(name, data)
        packed.writestr(link, "/etc/passwd")

    with pytest.raises(LogError, match=r"office_000009\.mcap' is no plain file"):
        sl.read(path)


def test_a_file_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    """Nobody can tell which of them is meant."""
    path = _zip(tmp_path / "office.zip", _office())
    first = segment_files(RECORDING)[0].name
    with zipfile.ZipFile(path, "a") as packed, pytest.warns(UserWarning, match="Duplicate"):
        packed.writestr(f"office/{first}", b"another")

    with pytest.raises(LogError, match="is there twice"):
        sl.read(path)


def test_what_is_packed_otherwise_is_refused(tmp_path: Path) -> None:
    """Every tool can pack it deflated."""
    path = _zip(tmp_path / "office.zip", _office(), zipfile.ZIP_LZMA)

    with pytest.raises(LogError, match="neither stored nor deflated"):
        sl.read(path)


def test_an_encrypted_zip_is_refused(tmp_path: Path) -> None:
    """The message says what to do."""
    path = _zip(tmp_path / "office.zip", _office())
    data = bytearray(path.read_bytes())
    at = -1
    while (at := data.find(b"PK\x01\x02", at + 1)) >= 0:
        data[at + 8] |= 1
    path.write_bytes(data)

    with pytest.raises(LogError, match="is encrypted; unpack it with its password"):
        sl.read(path)


@pytest.mark.slow
@pytest.mark.parametrize("is_honest", [True, False])
def test_a_bomb_is_not_unpacked(tmp_path: Path, temporary: Path, *, is_honest: bool) -> None:
    """Neither what says how much it holds, nor what lies about it."""
    path = tmp_path / "office.zip"
    name, zeros = "office/office_000009.mcap", bytes(2**20)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for one, data in _office().items():
            packed.writestr(one, data)
        with packed.open(name, "w") as member:
            for _ in range(FREE_BYTES // len(zeros) + 64):
                member.write(zeros)
    if not is_honest:
        data = bytearray(path.read_bytes())
        at = data.rindex(name.encode()) - 46
        struct.pack_into("<I", data, at + 24, 1000)  # its size, in the list of files
        path.write_bytes(data)

    assert path.stat().st_size * MOST_RATIO < FREE_BYTES
    said = r"refused: .* got [0-9,]+ bytes;" if is_honest else r"refused: .*|damaged: no zip"
    with pytest.raises(LogError, match=said):
        sl.read(path)

    gc.collect()
    assert list(temporary.iterdir()) == []


def test_what_is_unpacked_is_counted_whatever_the_zip_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Were the sizes in its list not looked at, it would be refused on the way."""
    monkeypatch.setattr(zipped, "_check_sizes", lambda *_: None)
    monkeypatch.setattr(zipped, "FREE_BYTES", 2**10)
    monkeypatch.setattr(zipped, "MOST_RATIO", 1)
    path = _zip(tmp_path / "office.zip", _office() | {"office/office_000001.mcap": bytes(2**22)})

    with pytest.raises(LogError, match="refused: expected files of at most"):
        sl.read(path)


def test_a_list_of_files_has_a_bound(tmp_path: Path) -> None:
    """It is held in memory, many times as large: 5 MB of list could become 100."""
    names = {f"{number:060d}/{'n' * 40}": b"" for number in range(MOST_LIST_BYTES // 147 + 1)}
    path = _zip(tmp_path / "office.zip", _office() | names, zipfile.ZIP_STORED)

    with pytest.raises(LogError, match="refused: expected a list of files of at most"):
        sl.read(path)


def test_no_room_for_it_is_said_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With where it would go, and how to choose another place."""
    path = _zip(tmp_path / "office.zip", _office())
    monkeypatch.setattr(zipped.shutil, "disk_usage", lambda _: type("U", (), {"free": 10})())

    with pytest.raises(LogAccessError, match="10 are free; set TMPDIR"):
        sl.read(path)


@pytest.mark.parametrize("at", [0.3, 0.6])
def test_a_damaged_zip_is_told_as_such(tmp_path: Path, temporary: Path, at: float) -> None:
    """Each file in a zip has a CRC."""
    path = _zip(tmp_path / "office.zip", _office())
    data = bytearray(path.read_bytes())
    data[int(len(data) * at)] ^= 0xFF
    path.write_bytes(data)

    with pytest.raises(LogError):
        sl.read(path)

    gc.collect()
    assert list(temporary.iterdir()) == []


def test_verify_names_the_zip(tmp_path: Path) -> None:
    """Not the folder into which it was unpacked, which is gone by then."""
    members = _office()
    first = next(name for name in members if name.endswith(".mcap"))
    members[first] = members[first][: len(members[first]) // 2]
    path = _zip(tmp_path / "office.zip", members)

    found = verify(path)

    assert found.exit_code in (3, 4)
    assert found.path == path
    assert {finding.path.parent for finding in found.findings} <= {path, path.parent}
    with pytest.raises(LogError, match=r"office\.zip/"):
        sl.read(path).replay()


def test_verify_tells_what_is_no_log_from_damage(tmp_path: Path) -> None:
    """By the exit codes that it has for folders."""
    nothing = _zip(tmp_path / "nothing.zip", {"readme.txt": b"hello"})
    cut = tmp_path / "cut.zip"
    cut.write_bytes(_zip(tmp_path / "whole.zip", _office()).read_bytes()[:-30])

    assert 5 == _main("verify", str(nothing))
    assert 4 == _main("verify", str(cut))


def _main(*arguments: str) -> int:
    try:
        main(arguments)
    except SystemExit as end:
        return int(end.code or 0)
    return 0
