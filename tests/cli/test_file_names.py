"""Names of files and folders on the command line that cannot be meant as they are written."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.main import get_command

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.cli.app import app
from semmap_log.errors import LogError


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with the log `office` in it."""
    monkeypatch.chdir(tmp_path)
    sl.create("office", tz="UTC").close()
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    captured = capsys.readouterr()
    return int(left.value.code or 0), captured.out + captured.err


@pytest.mark.parametrize("name", ["x.zip", "sub/x.ZIP", "x.mcap", "-"])
def test_a_new_log_is_not_called_as_a_file_is(
    name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder x.zip would be taken for a packed log by people, and by no program."""
    code, said = run(capsys, "init", "--", name)

    assert 1 == code
    assert f"{name}: " in said
    assert "folder" in said
    if name == "x.zip":
        assert "leave .zip out: semmap-log init x\n" in said
    with pytest.raises(LogError, match="folder"):
        sl.create(name)
    assert ["office"] == [path.name for path in here.iterdir()]


@pytest.mark.parametrize("verb", ["export", "costmap", "report"])
def test_no_file_is_called_as_standard_output_is(
    verb: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It would be a folder, a bag of rosbag2."""
    code, said = run(capsys, verb, "office", "-")

    assert 2 == code
    assert "expected a file's name, got -" in said
    assert ["office"] == [path.name for path in here.iterdir()]


@pytest.mark.parametrize("verb", ["replay", "info", "observe", "compact"])
def test_a_zip_that_is_not_there_is_not_made_by_init(
    verb: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is a file that is missing; a folder can be made."""
    door = ["1", "open"] if verb == "observe" else []
    code, said = run(capsys, verb, "missing.zip", *door)
    folder = run(capsys, verb, "missing", *door)[1]

    assert 1 == code
    assert "missing.zip: no such file; a log is a folder" in said
    assert "init" not in said
    assert "semmap-log init missing" in folder


def test_help_points_to_where_its_text_is(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Options come last: what explains them stands above."""
    verbs = get_command(app).commands  # type: ignore[attr-defined]

    for name in verbs:
        said = " ".join(run(capsys, name, "--help")[1].split())
        assert "see below" not in said, name
