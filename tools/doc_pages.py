"""Runs the examples of the documentation's pages, as a reader would, and compares their output.

    python tools/doc_pages.py docs/quickstart.md     write what the commands print into the page

What is run depends on a block's language:

    console   commands behind `$ `; what follows each is its output in a terminal, 100 columns wide
    sh        commands; they must end well
    pycon     an interactive session, one for the whole page
    python    a program of its own; it must end well

In outputs `...` stands for anything, and times of the last minutes stand for each other. Other
blocks (bash, text, yaml, json) are not run. All that a page runs, it runs in one new folder with a
copy of the recordings; a `cd` holds for the blocks after it. Where a command would open the viewer
(`semmap-log view`), the recording is written to a file instead.
"""

from __future__ import annotations

import doctest
import fcntl
import os
import pty
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
from dataclasses import dataclass
from datetime import date, datetime, timedelta, timezone
from pathlib import Path

ROOT = Path(__file__).parents[1]
COLUMNS = 100
RUN = ("console", "sh", "pycon", "python")

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_STYLE = re.compile(r"\x1b\[[0-9;]*m")
"""What makes a terminal write bold or in colours."""
_VIEW = re.compile(r"semmap-log view (\S+).*")


@dataclass(frozen=True)
class Block:
    """Something to run."""

    language: str
    text: str
    line: int
    """Of the page, where its text begins."""


class WrongOutput(AssertionError):  # noqa: N818  # what a test shows
    """An example does not do what its page says."""


def blocks_of(page: str) -> list[Block]:
    """Return what a page's text has to run, in order."""
    return [
        Block(match[1], match[2], page.count("\n", 0, match.start(2)) + 1)
        for match in _BLOCK.finditer(page)
        if match[1] in RUN
    ]


def examples_of(console: str) -> list[tuple[str, str]]:
    """Return (command, expected output) of a console block."""
    found: list[tuple[str, list[str]]] = []
    for line in console.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        elif found and found[-1][0].endswith("\\") and not found[-1][1]:
            found[-1] = (f"{found[-1][0]}\n{line}", [])
        else:
            found[-1][1].append(line)
    return [(command, "\n".join(lines)) for command, lines in found]


class Runner:
    """Runs the blocks of one page in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(ROOT / "recordings", folder / "recordings")
        bin_folder = folder / ".bin"
        bin_folder.mkdir()
        program = bin_folder / "semmap-log"
        program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m semmap_log "$@"\n')
        program.chmod(0o755)
        path = f"{bin_folder}{os.pathsep}{Path(sys.executable).parent}"
        self._environment = {
            **os.environ,
            "PATH": f"{path}{os.pathsep}{os.environ['PATH']}",
            "NO_COLOR": "1",
            "TERM": "xterm",
            "COLUMNS": str(COLUMNS),
            "LEFT_IN": str(bin_folder / "left_in"),
        }
        self._names: dict[str, object] = {"__name__": "__main__"}

    def run(self, block: Block) -> None:
        """Run a block.

        Raises:
            WrongOutput: It does not do what the page says.
        """
        if block.language == "console":
            for command, expected in examples_of(block.text):
                got = self.output_of(command)
                if not fits(expected, got):
                    problem = f"$ {command}\nexpected:\n{expected}\ngot:\n{got}"
                    raise WrongOutput(f"line {block.line}: {problem}")
        elif block.language == "pycon":
            self._run_session(block)
        else:
            shell = ["bash", "-euo", "pipefail", "-c", _script(block.text)]
            line = shell if block.language == "sh" else [sys.executable, "-c", block.text]
            done = subprocess.run(
                line, cwd=self._here(), env=self._environment, capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            if done.returncode:
                raise WrongOutput(f"line {block.line}: {block.text}\n{done.stdout}{done.stderr}")

    def output_of(self, command: str) -> str:
        """Return what a command prints in a terminal: first stdout, then stderr."""
        terminal, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, COLUMNS, 0, 0))
        with tempfile.TemporaryFile() as errors:
            running = subprocess.Popen(
                ["bash", "-uo", "pipefail", "-c", _script(command)],
                cwd=self._here(), env=self._environment, stdin=subprocess.DEVNULL, stdout=slave,
                stderr=errors,
            )  # fmt: skip
            os.close(slave)
            said = _all_of(terminal)
            running.wait()
            errors.seek(0)
            said += errors.read()
        lines = _STYLE.sub("", said.decode()).replace("\r\n", "\n").splitlines()
        return "\n".join(line.rstrip() for line in lines)

    def _here(self) -> Path:
        """Return the folder that the last block has gone to."""
        left_in = Path(self._environment["LEFT_IN"])
        return Path(left_in.read_text().rstrip("\n")) if left_in.exists() else self.folder

    def _run_session(self, block: Block) -> None:
        name = f"line {block.line}"
        test = doctest.DocTestParser().get_doctest(block.text, self._names, name, name, block.line)
        test.globs = self._names  # one session a page
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS, verbose=False)
        said: list[str] = []
        before = Path.cwd()
        os.chdir(self._here())
        try:
            runner.run(test, out=said.append, clear_globs=False)
        finally:
            os.chdir(before)
        if runner.failures:
            raise WrongOutput("".join(said))


def fits(expected: str, got: str) -> bool:
    """Tell whether an output is the expected one.

    `...` stands for anything. Where the output tells of the last minutes, the page may tell of
    others: of the time when it was written.
    """
    same = doctest.OutputChecker().check_output
    if same(f"{expected}\n", f"{got}\n", doctest.ELLIPSIS):
        return True
    recent, now = masked(got, datetime.now(timezone.utc)), masked(expected, None)
    return recent != got and same(now, recent, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)


def masked(text: str, now: datetime | None) -> str:
    """Return a text without its times of the last minutes; without all its times, if None.

    Around midnight a table has a day where the page has none: so nothing is put in their place.
    """

    def mask(match: re.Match[str]) -> str:
        if now is None:
            return ""
        if match["minute"]:  # whatever the zone, which is whole hours away
            told_s = 60 * int(match["minute"]) + int(match["second"])
            is_recent = (60 * now.minute + now.second - told_s) % 3600 < RECENT_S
        elif match["age"]:
            is_recent = int(match["age"]) * (1 if match["unit"] == "s" else 60) < RECENT_S
        else:
            is_recent = abs(date.fromisoformat(match["day"]) - now.date()) <= timedelta(days=1)
        return "" if is_recent else match[0]

    return _TIME.sub(mask, text)


RECENT_S = 1200
_TIME = re.compile(
    r"(?P<day>\d{4}-\d\d-\d\d)|\d\d:(?P<minute>\d\d):(?P<second>\d\d)(\.\d+)?"
    r"|\b(?P<age>\d+) (?P<unit>s|min)\b"
)


def _script(command: str) -> str:
    """Return the command, which then says in which folder it ends.

    A viewer's recording goes to a file, since there may be no screen.
    """
    shown = _VIEW.sub(r"semmap-log view \1 --save shown.rrd", command)
    return f"trap 'pwd > \"$LEFT_IN\"' EXIT\n{shown}"


def _all_of(terminal: int) -> bytes:
    """Return all that is written to a terminal until nobody holds its other end."""
    parts = []
    with os.fdopen(terminal, "rb", buffering=0) as file:
        while True:
            try:
                part = file.read(2**16)
            except OSError:  # EIO: as Linux tells the end
                break
            if not part:
                break
            parts.append(part)
    return b"".join(parts)


def rewritten(page: str, folder: Path) -> str:
    """Return a page with what its console blocks print now; what fits already stays."""
    runner, parts, done = Runner(folder), [], 0
    for match in _BLOCK.finditer(page):
        if match[1] not in RUN:
            continue
        if match[1] != "console":
            runner.run(Block(match[1], match[2], page.count("\n", 0, match.start(2)) + 1))
            continue
        told = []
        for command, expected in examples_of(match[2]):
            got = runner.output_of(command)
            text = expected if fits(expected, got) else got
            told += [f"$ {command}", *([text] if text else [])]
        parts += [page[done : match.start(2)], "\n".join(told), "\n"]
        done = match.end(2)
    return "".join([*parts, page[done:]])


def main() -> None:
    """Write outputs into the pages that the command line names."""
    for name in sys.argv[1:]:
        path = Path(name)
        with tempfile.TemporaryDirectory() as folder:
            text = rewritten(path.read_text(encoding="utf-8"), Path(folder))
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
