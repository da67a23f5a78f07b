"""The token's file: readable by its owner alone, and long enough."""

from __future__ import annotations

from pathlib import Path

import pytest

from semmap_log.errors import AddressError
from semmap_log.live.planners.line_protocol.tokens import is_token, read_token

TOKEN = "0123456789abcdef"


def _file(tmp_path: Path, text: str, mode: int = 0o600) -> Path:
    path = tmp_path / "token"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_a_token_is_a_line(tmp_path: Path) -> None:
    """Its end does not count."""
    assert TOKEN == read_token(_file(tmp_path, f"{TOKEN}\n"))
    assert TOKEN == read_token(_file(tmp_path, TOKEN, 0o400))


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o777])
def test_a_file_that_others_may_read_or_write_is_refused(tmp_path: Path, mode: int) -> None:
    """With the command that mends it."""
    with pytest.raises(AddressError, match=f"mode {mode:o}.*chmod 600"):
        read_token(_file(tmp_path, TOKEN, mode))


@pytest.mark.parametrize("text", ["", "short", "two\nlines of a token", "with blank 0123456789",
                                  "ä" * 20, "x" * 5000])  # fmt: skip
def test_what_is_no_token(tmp_path: Path, text: str) -> None:
    """Too short, too long, or nothing that a line of words can hold."""
    with pytest.raises(AddressError, match="expected a token"):
        read_token(_file(tmp_path, text))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    """Or is no text."""
    with pytest.raises(AddressError, match="the token cannot be read"):
        read_token(tmp_path / "nowhere")
    path = _file(tmp_path, "")
    path.write_bytes(b"\xff" * 20)
    with pytest.raises(AddressError, match="the token cannot be read"):
        read_token(path)


def test_who_gives_it() -> None:
    """To the letter; line ends as they come."""
    assert is_token(f"TOKEN {TOKEN}".encode(), TOKEN)
    assert is_token(f"TOKEN {TOKEN}\r".encode(), TOKEN)
    for other in (f"TOKEN {TOKEN}0", f"TOKEN {TOKEN[:-1]}", TOKEN, "", "TOKEN \udcff"):
        assert not is_token(other.encode(errors="surrogateescape"), TOKEN)
