"""Texts from outside, on a terminal: names of doors, files and folders that would steer it."""

from __future__ import annotations

import io
import json
import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest
from rich.table import Table
from rich.text import Text

import semmap_log as sl
from semmap_log.cli.printer import PlainConsole
from semmap_log.cli.sanitized_streams import PlainStream, json_text, plain, sanitized_streams

TITLE = "\x1b]0;owned\x07"
EVIL = f"[red]x$\\frac{{$:door:{TITLE}\u202e\x9b31m"
FOLDER = os.fsdecode(b"l\xff\x1b[31m\xc3\xbcg")
"""Not UTF-8, and with an escape sequence."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("evil") / FOLDER
    with sl.create(path, tz="UTC") as opened:
        door = opened.add_door(
            name=EVIL, x=0, y=0, theta=0, width=1, prob_open=0.5, prob_closed=0.5,
            actor=EVIL, reason=EVIL, source=EVIL,
        )  # fmt: skip
        opened.annotate(door, EVIL, EVIL)
        opened.observe(door, "open", accuracy=0.9, actor=EVIL)
    return path


def _run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "semmap_log", *arguments], capture_output=True, text=True,
        errors="surrogateescape", check=False, timeout=200,
    )  # fmt: skip


def _steering(text: str) -> set[str]:
    return {c for c in text if not c.isprintable() and c != "\n"}


VERBS = [
    ["replay"], ["history"], ["show", "0"], ["tail"], ["info"], ["verify"], ["timeline", "1"],
    ["diff", "event:0", "event:2"], ["probabilities"], ["best-time", "1"], ["compact"],
    ["redact", "--notes", "--dry-run"], ["retain", "--keep", "1d", "--dry-run"],
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb[0])
def test_no_verb_hands_on_what_steers_a_terminal(log: Path, verb: list[str]) -> None:
    """Nor in JSON, where it is an escape of JSON's. Tabs stand between the cells of a table."""
    for more in ([], ["--json"]):
        ended = _run(verb[0], log, *verb[1:], *more)

        assert 0 == ended.returncode, ended.stderr
        assert set() == _steering(ended.stdout + ended.stderr) - ({"\t"} if not more else set())
        assert "\t" not in ended.stderr


@pytest.mark.slow
def test_json_is_exact(log: Path) -> None:
    """What a program reads is the name itself."""
    shown = json.loads(_run("show", log, "0", "--json").stdout)
    (door,) = json.loads(_run("replay", log, "--json").stdout)["doors"]

    assert EVIL == shown["actor"] == shown["reason"]
    assert EVIL == door["name"]


@pytest.mark.slow
def test_brackets_and_colons_are_no_markup(log: Path) -> None:
    """`[red]` and `:door:` in a name are these letters."""
    for verb in ("replay", "history"):
        shown = "".join(_run(verb, log).stdout.split())
        assert "[red]x$" in shown
        assert ":door:" in shown


@pytest.mark.slow
def test_errors_name_files_plainly(tmp_path: Path, log: Path) -> None:
    """Of bags, of usage, of folders that are not there."""
    bad = tmp_path / f"{FOLDER}.mcap"
    bad.write_bytes(b"nonsense")
    for arguments in (
        ("import", log, bad), ("replay", tmp_path / f"no{FOLDER}"), ("replay", log, f"--{EVIL}"),
        (EVIL,), ("update", log, EVIL + "?", "--state", EVIL), ("report", log, bad),
        ("export", log, tmp_path / FOLDER / "no" / "x.csv"),
    ):  # fmt: skip
        ended = _run(*arguments)

        assert ended.returncode in (1, 2), arguments
        assert "Traceback" not in ended.stderr
        assert ended.stderr
        assert set() == _steering(ended.stderr), arguments


@pytest.mark.slow
def test_the_report_of_a_log_whose_name_is_not_utf8(tmp_path: Path, log: Path) -> None:
    """Its bytes are spelt out in the title; the page itself is UTF-8."""
    out = tmp_path / os.fsdecode(b"\xfe.html")

    ended = _run("report", log, out)

    assert 0 == ended.returncode, ended.stderr
    assert "l\\\\xff" in out.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_file_whose_name_is_not_utf8_is_imported(tmp_path: Path) -> None:
    """The note tells where it came from, its bytes spelt out."""
    file = tmp_path / os.fsdecode(b"\xfed.csv")
    file.write_text("timestamp,door,state\n2026-01-01T10:00,front,open\n")
    sl.create(tmp_path / "log", tz="UTC").close()

    ended = _run("import", tmp_path / "log", file)

    assert 0 == ended.returncode, ended.stderr
    assert {"\\xfed.csv"} == {entry.source for entry in sl.read(tmp_path / "log").history()}


@pytest.mark.slow
def test_on_a_terminal_there_are_colours_and_nothing_else(log: Path) -> None:
    """Rich's own sequences reach it; those in a name do not."""
    outer, inner = pty.openpty()
    with os.fdopen(outer, "rb", buffering=0) as terminal:
        command = [sys.executable, "-m", "semmap_log", "replay", log]
        environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "100"}
        with subprocess.Popen(command, stdout=inner, stderr=inner, env=environment):
            os.close(inner)
            shown = bytearray()
            try:
                while piece := terminal.read(4096):
                    shown += piece
            except OSError:  # so a terminal ends
                pass

    assert b"\x1b[32mOPEN" in shown
    assert TITLE.encode() not in shown
    assert "\x9b".encode() not in shown


def test_a_console_draws_what_is_handed_to_it() -> None:
    """Even what a table was given unseen."""
    stream = io.StringIO()
    console = PlainConsole(PlainStream(stream))  # type: ignore[arg-type]
    table = Table(f"[b]{TITLE}")
    table.add_row(f"[red]{TITLE}")
    console.print(table)
    console.print(Text(TITLE))
    console.print(f"[bold]:smile: {TITLE}")

    assert set() == _steering(stream.getvalue())
    assert "[bold]:smile: \\x1b]0;owned" in stream.getvalue()
    assert "[red]" in stream.getvalue()


def test_streams_are_as_before_behind_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """And bytes cannot pass by meanwhile."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="backslashreplace")
    monkeypatch.setattr(sys, "stdout", out)

    with sanitized_streams(), sanitized_streams():
        sys.stdout.write(f"{EVIL}\n")
        sys.stdout.writelines(["two\n", f"{TITLE}\n"])
        assert not hasattr(sys.stdout, "buffer")

    assert sys.stdout is out
    out.flush()
    assert set() == _steering(out.buffer.getvalue().decode())  # type: ignore[attr-defined]


def test_what_is_plain_stays() -> None:
    """Letters of all languages, and line ends; only what is not to be seen is spelt out."""
    assert "Tür 門\nzwei" == plain("Tür 門\nzwei")
    assert "\\t\\r\\x1b\\u202e\\udcff" == plain("\t\r\x1b\u202e\udcff")
    for value in ("Tür", "\x7f\x9b\u202e", "\U000e0001", "plain", "\n\t"):
        text = json_text({"a": [value]}, indent=2)
        assert {"a": [value]} == json.loads(text)
        assert set() == _steering(text)
