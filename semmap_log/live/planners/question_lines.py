r"""Questions and answers as lines: words, or JSON.

    DOOR_OPEN DOOR_3                          T
    DOOR_OPEN "main door" "2h ago"            NIL
    #<32 hex digits> SET_DOOR_OPEN DOOR_3     T
    DOORS OPEN                                (DOOR_1 DOOR_2)
    {"ask": "DOOR_OPEN", "args": ["DOOR_9"]}  {"answer": false, "reason": "no door DOOR_9 …"}

A word with blanks, quotes or control characters is a JSON string, in questions and in answers. An
answer has none but visible characters, whatever names are in a log: others are written as `\u200f`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from semmap_log.errors import QuestionError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.formats.parsing.strict_json import StrictJsonError, load_object
from semmap_log.live.planners import parsed_questions

MOST_LINE_BYTES = 2**16
"""Of a question, its end included."""

MOST_ID_BYTES = 256
"""Of the `id` of a question in JSON, as it is written in the answer."""

TRUE, NIL, ERROR = "T", "NIL", "ERROR"


class Atom(str):
    """A word that an answer names as it is, such as `DOOR_3` or `OPEN`."""

    __slots__ = ()


Value: TypeAlias = "bool | int | float | str | Atom | Sequence[Value] | None"
"""Of an answer; a predicate that does not hold is False, a function without a value None."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a question is answered."""

    value: Value
    reason: str = ""
    """Why it is False or None, where that is known."""


@dataclass(frozen=True, slots=True)
class Line:
    """A question as it came on a line."""

    asked: parsed_questions.ParsedQuestion
    is_json: bool = False
    given_id: Any = field(default=None, compare=False)
    """What the answer in JSON is to be known by; None: nothing."""


def read_line(data: bytes) -> Line:
    """Return the question on a line.

    Args:
        data: The line without its end.

    Raises:
        LineError: There is none that can be understood.
    """
    is_json = data.startswith(b"{")
    given_id = None
    try:
        _check_length(data)
        if is_json:
            asked_for = _object(data)
            given_id = _id_in(asked_for)
            return Line(_of_object(asked_for), is_json=True, given_id=given_id)
        return Line(_of_text(data))
    except QuestionError as error:
        raise LineError(str(error), is_json=is_json, given_id=given_id) from None


def _check_length(data: bytes) -> None:
    if len(data) >= MOST_LINE_BYTES:
        raise QuestionError(too_long())


class LineError(QuestionError):
    """A line that cannot be understood; it knows how it is to be answered."""

    def __init__(self, problem: str, *, is_json: bool = False, given_id: Any = None) -> None:
        super().__init__(problem)
        self.is_json = is_json
        self.given_id = given_id


def too_long() -> str:
    """Return the message about a line that is too long."""
    return f"expected a line of at most {MOST_LINE_BYTES:,} bytes, got a longer one"


def write_answer(line: Line, answer: Answer) -> bytes:
    """Return the line that answers a question, with its end."""
    if not line.is_json:
        return f"{text_of(answer.value)}\n".encode()
    said: dict[str, Any] = {"answer": answer.value}
    if answer.reason:
        said["reason"] = answer.reason
    return _json_line(said, line.given_id)


def write_error(problem: str, *, is_json: bool = False, given_id: Any = None) -> bytes:
    """Return the line that answers a question that cannot be answered, with its end."""
    if is_json:
        return _json_line({"error": problem}, given_id)
    return f"{ERROR} {quoted(problem)}\n".encode()


def text_of(value: Value) -> str:
    """Return a value as words."""
    if value is True:
        return TRUE
    if value is None or value is False:
        return NIL
    if isinstance(value, Atom):
        return str(value)
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, (int, float)):
        return repr(value)
    return f"({' '.join(map(text_of, value))})"


def quoted(text: str) -> str:
    """Return a text as a JSON string of nothing but visible characters."""
    return _visible(json.dumps(text, ensure_ascii=False))


def problem_of(answer: str) -> str | None:
    """Return what an answer says is wrong with its question; None: it is answered."""
    if answer.startswith("{"):
        said = json.loads(answer)
        return str(said["error"]) if "error" in said else None
    if answer.startswith(f"{ERROR} "):
        return str(json.loads(answer.removeprefix(f"{ERROR} ")))
    return None


def is_answer(line: str) -> bool:
    """Return whether a line can be the answer to a question; else another program sent it."""
    return _ANSWER.match(line) is not None


_ANSWER = re.compile(r'[A-Z_0-9]+$|ERROR "|-?[0-9]|["({]')


def as_json_line(text: str) -> str:
    """Return a question in words as one in JSON.

    Raises:
        QuestionError: A quoted word is no JSON string.
    """
    words = split_words(text)
    asked: dict[str, Any] = {}
    if words and words[0].startswith("#"):
        asked["command_id"] = words.pop(0)[1:]
    return _visible(json.dumps({"ask": words[0] if words else "", "args": words[1:], **asked}))


def as_word(text: str) -> str:
    """Return a text as a word of a question: as it is where it is plain, else quoted."""
    return text if _PLAIN.fullmatch(text) and text.isprintable() else quoted(text)


def split_words(text: str) -> list[str]:
    """Return the words of a question in words.

    Raises:
        QuestionError: A quoted one is no JSON string, or there are too many.
    """
    if '"' not in text:
        return [word for word in text.replace("\t", " ").split(" ") if word]
    words: list[str] = []
    at = 0
    while at < len(text):
        if len(words) > parsed_questions.MOST_WORDS + 1:  # a command id is none
            raise QuestionError(parsed_questions.too_many())
        found = _WORD.match(text, at)
        if found is None:
            raise QuestionError(
                f"expected words with blanks between, and quotes around those with blanks in them, "
                f"got {shown(text[at:])}"
            )
        at = found.end()
        if found["plain"]:
            words.append(found["plain"])
        elif found["quoted"]:
            words.append(_unquoted(found["quoted"]))
    return words


_WORD = re.compile(r'(?:(?P<quoted>"(?:[^"\\]|\\.)*")|(?P<plain>[^ \t"]+))?(?:[ \t]+|$)')
_PLAIN = re.compile(r'[^ "{#(][^ "]*')


def _unquoted(word: str) -> str:
    try:
        text: str = json.loads(word)
    except ValueError as error:
        raise QuestionError(f"{shown(word)} is no JSON string: {error}") from None
    return text


def _of_text(data: bytes) -> parsed_questions.ParsedQuestion:
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        raise QuestionError(
            f"expected UTF-8 text, got byte 0x{data[error.start]:02x} at {error.start + 1}"
        ) from None
    if control := _CONTROL.search(text):
        raise QuestionError(
            f"expected text without control characters, got {control[0]!r} at "
            f'{control.start() + 1}; inside of quotes it is written "\\n" or "\\u0000"'
        )
    words = split_words(text)
    command_id = None
    if words and words[0].startswith("#"):
        command_id = read_command_id(words[0][1:])
        del words[0]
    return parsed_questions.read_words(words, command_id)


_CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")


def read_command_id(text: object) -> bytes:
    """Return the command id that 32 hexadecimal digits are.

    Raises:
        QuestionError: They are none.
    """
    if not isinstance(text, str) or not _COMMAND_ID.fullmatch(text):
        raise QuestionError(f"expected a command id of 32 hexadecimal digits, got {shown(text)}")
    return bytes.fromhex(text)


_COMMAND_ID = re.compile(r"[0-9a-fA-F]{32}")

_KEYS = {"ask", "args", "at", "known_at", "command_id"}


def _object(data: bytes) -> dict[str, Any]:
    try:
        return load_object(data)
    except StrictJsonError as error:
        raise QuestionError(str(error)) from None


def _id_in(asked_for: dict[str, Any]) -> Any:
    """Take out by what the answer is to be known; None: by nothing.

    Raises:
        QuestionError: It is too long, or too deep: it is not repeated, then.
    """
    given_id = asked_for.pop("id", None)
    try:
        length = len(json.dumps(given_id))
    except RecursionError:
        length = MOST_LINE_BYTES
    if length > MOST_ID_BYTES:
        raise QuestionError(f"id: expected at most {MOST_ID_BYTES} bytes, got more")
    return given_id


def _of_object(asked_for: dict[str, Any]) -> parsed_questions.ParsedQuestion:
    """Return the question of a JSON object: its `args` are words, and its times follow them."""
    if unknown := asked_for.keys() - _KEYS:
        raise QuestionError(f"key {shown(min(unknown))}: expected one of {sorted(_KEYS | {'id'})}")
    given = asked_for.get("args", [])
    if not isinstance(given, list):
        raise QuestionError(f"args: expected a list, got {shown(given)}")
    words: list[parsed_questions.Word] = [_word("ask", asked_for.get("ask", "")), *_words(given)]
    if asked_for.get("at") is not None:
        words.append(_word("at", asked_for["at"]))
    if asked_for.get("known_at") is not None:
        words = ["BELIEVED", *words, "AT", _word("known_at", asked_for["known_at"])]
    command_id = asked_for.get("command_id")
    return parsed_questions.read_words(
        words, None if command_id is None else read_command_id(command_id)
    )


def _words(given: list[Any]) -> list[parsed_questions.Word]:
    """Return the arguments as words; the doors of NEXT_DOOR may stand in a list of their own."""
    words: list[parsed_questions.Word] = []
    for each in given:
        words += map(_argument, each) if isinstance(each, list) else [_argument(each)]
        if len(words) > parsed_questions.MOST_WORDS:
            raise QuestionError(parsed_questions.too_many())
    return words


def _argument(value: Any) -> parsed_questions.Word:
    return _word("args", value)


def _word(key: str, value: Any) -> parsed_questions.Word:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise QuestionError(f"{key}: expected a text or a number, got {shown(value)}")
    return value


def _json_line(said: dict[str, Any], given_id: Any) -> bytes:
    if given_id is not None:
        said["id"] = given_id
    return f"{_visible(json.dumps(said, ensure_ascii=False, allow_nan=False))}\n".encode()


def _visible(text: str) -> str:
    if text.isascii() and "\x7f" not in text:
        return text
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in text)
