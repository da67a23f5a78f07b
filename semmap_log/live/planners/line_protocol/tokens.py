"""The secret by which a server knows its clients, where others than its user can reach it.

`AskClient` is the other end: it connects, gives the secret, and sends questions.
"""

from __future__ import annotations

import hmac
import os
import stat
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from semmap_log.errors import AddressError, QuestionError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.live.planners.addresses import Address
from semmap_log.live.planners.question_lines import is_answer, problem_of

if TYPE_CHECKING:
    from typing_extensions import Self


MOST_ANSWER_BYTES = 2**24
"""Whoever sends a longer line is no server of ours."""


class AskClient:
    """A connection that asks one question after the other."""

    def __init__(
        self, address: Address, *, token: str | None = None, timeout_s: float | None = None
    ) -> None:
        """Connect.

        Args:
            address: Of the server.
            token: What it wants to know; None: nothing.
            timeout_s: How long to wait for an answer; None: as long as it takes.

        Raises:
            AddressError: Nobody answers, or the token is wrong.
        """
        self._address = address
        self._timeout_s = timeout_s
        self._socket = address.connect()
        self._socket.settimeout(timeout_s)
        self._lines = self._socket.makefile("rb")
        if token is not None and (answer := self.ask(f"{TOKEN} {token}")) != "T":
            self.close()
            raise AddressError(
                f"{address}: the server refused this token: it expects another one, or none. "
                f"Its answer: {problem_of(answer) or answer}"
            )

    def ask(self, question: str) -> str:
        """Return the line that answers a question.

        Raises:
            QuestionError: It has a line end within, and would be two; or is no UTF-8 text.
            AddressError: What listens there is no server of questions. Or the server has gone, or
                does not answer in time; whether an action was done is not known: sent again with
                the same command id, it is done once. This connection is closed: what still came
                on it would be another question's answer.
        """
        line = _line_of(question)
        if self._socket.fileno() < 0:
            raise AddressError(f"{self._address}: the connection is closed; connect again.")
        answer = b""
        try:
            self._socket.sendall(line)
            answer = self._lines.readline(MOST_ANSWER_BYTES)
        except TimeoutError:
            raise AddressError(
                f"{self._address}: no answer within {self._timeout_s:g} s."
            ) from None
        except OSError as error:
            raise self._gone(str(error.strerror or error)) from error
        finally:
            if not answer.endswith(b"\n"):
                self.close()
        if len(answer) == MOST_ANSWER_BYTES:
            raise self._gone(f"an answer of more than {MOST_ANSWER_BYTES // 2**20} MiB")
        if not answer.endswith(b"\n"):
            raise self._gone("the connection ended")
        said = answer[:-1].decode(errors="replace")
        if not is_answer(said):
            raise AddressError(
                f"{self._address}: another program listens there: expected an answer such as T or "
                f"NIL, got {shown(said)}."
            )
        return said

    def close(self) -> None:
        """Leave."""
        self._lines.close()
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _gone(self, why: str) -> AddressError:
        return AddressError(f"{self._address}: the server has gone: {why}.")


def _line_of(question: str) -> bytes:
    if "\n" in question:
        raise QuestionError(f"expected a question on one line, got {question!r}.")
    try:
        return f"{question}\n".encode()
    except UnicodeEncodeError as error:
        raise QuestionError(
            f"expected UTF-8 text, got {question[error.start]!r} at {error.start + 1}"
        ) from None


LEAST_TOKEN = 16
"""Characters: fewer can be guessed."""
MOST_TOKEN = 4096

TOKEN = "TOKEN"  # noqa: S105  the word, not one


def read_token(path: Path) -> str:
    """Return the token that a file holds: its one line.

    Raises:
        AddressError: The file cannot be read, others than its owner may read it, or it holds none.
    """
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            token = file.read(MOST_TOKEN + 1).decode().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise AddressError(f"{path}: the token cannot be read: {error}") from error
    if mode & 0o077:
        raise AddressError(
            f"{path}: others may read the token (mode {mode:o}); expected 600: chmod 600 {path}"
        )
    if not (LEAST_TOKEN <= len(token) <= MOST_TOKEN and token.isascii() and token.isprintable()):
        raise AddressError(
            f"{path}: expected a token of at least {LEAST_TOKEN} letters and digits on one line; "
            "to make one: head -c 24 /dev/urandom | base64"
        )
    if " " in token:
        raise AddressError(f"{path}: expected a token without blanks.")
    return token


def is_token(line: bytes, token: str) -> bool:
    """Return whether a line gives the token; it takes as long whatever it gives instead."""
    return hmac.compare_digest(line.strip(), f"{TOKEN} {token}".encode())
