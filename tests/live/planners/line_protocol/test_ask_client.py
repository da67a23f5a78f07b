"""Lines that are too long, on either end of a client of questions."""

from __future__ import annotations

import io
import socket
import sys
import threading
from pathlib import Path

import pytest

from semmap_log.cli.ask import _lines_of_stdin
from semmap_log.errors import AddressError
from semmap_log.live.planners.addresses import UnixAddress
from semmap_log.live.planners.line_protocol import tokens
from semmap_log.live.planners.line_protocol.tokens import AskClient
from semmap_log.live.planners.question_lines import MOST_LINE_BYTES


def test_an_answer_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What listens there may be any program."""
    monkeypatch.setattr(tokens, "MOST_ANSWER_BYTES", 2**20)
    path = tmp_path / "stranger"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()
        stranger = threading.Thread(target=talk, args=(listener,), daemon=True)
        stranger.start()
        with (
            AskClient(UnixAddress(path), timeout_s=20) as client,
            pytest.raises(AddressError, match="an answer of more than 1 MiB"),
        ):
            client.ask("DOORS")
        stranger.join(20)
    assert not stranger.is_alive()


def talk(listener: socket.socket) -> None:
    """Send what never ends, until the other end has gone."""
    with listener.accept()[0] as client:
        try:
            while True:
                client.sendall(b"x" * 2**16)
        except OSError:
            return


def test_of_a_long_line_of_stdin_no_more_is_read_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its beginning is asked, which the server refuses; the line after it is one of its own."""
    long = "x" * (5 * MOST_LINE_BYTES)
    monkeypatch.setattr(sys, "stdin", io.StringIO(f"HELP\n{long}\nDOORS\r\n{long}"))

    lines = list(_lines_of_stdin())

    assert lines == ["HELP", long[:MOST_LINE_BYTES], "DOORS", long[:MOST_LINE_BYTES]]
