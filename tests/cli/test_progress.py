"""The bar of long work, on a real terminal; and nothing of it elsewhere."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys

import pytest

WORK = """
import sys, time
from semmap_log.cli.common import progress
with progress("Working", unit=sys.argv[1]) as told:
    for done in range(24):
        time.sleep(0.08)
        if told is not None:
            told(done * int(sys.argv[2]), 24 * int(sys.argv[2]))
"""


HOUR_NS = 3_600 * 10**9


@pytest.mark.parametrize(
    ("unit", "each", "rate"),
    [
        ("bytes", HOUR_NS, r"[\d.]+ [TGM]B/s"),
        ("ns", HOUR_NS, r"\d+ (h|min).* of the log/s"),
        ("visits", 1_000, r"[\d,]+ visits/s"),
    ],
)
def test_a_bar_says_how_fast_and_fits_the_line(unit: str, each: int, rate: str) -> None:
    """In 80 columns: how far, how fast, how long still."""
    said = on_a_terminal([sys.executable, "-c", WORK, unit, str(each)])

    drawn = [line for line in re.split(r"[\r\n]", said) if "Working" in line]
    assert drawn
    assert all(len(line.rstrip()) <= 80 for line in drawn)
    assert re.search(rate, drawn[-1])
    assert re.search(r"0:00:0\d", drawn[-1])


def test_piped_there_is_no_bar() -> None:
    """Nothing at all on stderr."""
    done = subprocess.run(
        [sys.executable, "-c", WORK, "bytes", "1"], capture_output=True, check=True
    )

    assert b"" == done.stderr + done.stdout


def on_a_terminal(command: list[str]) -> str:
    """Return what a program writes to a terminal of 80 columns, without colours."""
    child, line = pty.fork()
    if child == 0:
        os.environ |= {"COLUMNS": "80", "TERM": "xterm"}
        os.execv(command[0], command)
    said = b""
    while True:
        try:
            part = os.read(line, 65536)
        except OSError:  # its end, as Linux tells it
            break
        if not part:
            break
        said += part
    os.close(line)
    assert 0 == os.waitpid(child, 0)[1]
    return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", said.decode())
