"""Lines of words and of JSON: what is said is what is read, and nobody's words break a line."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.errors import QuestionError
from semmap_log.live.planners.question_lines import (
    MOST_LINE_BYTES,
    Answer,
    Atom,
    LineError,
    as_json_line,
    as_word,
    problem_of,
    read_line,
    split_words,
    text_of,
    write_answer,
    write_error,
)

anything = st.text(st.characters())
"""Lone surrogates, line ends, NUL and marks that turn the writing round among it."""
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | anything | st.integers(0, 99).map(lambda n: Atom(f"DOOR_{n}")),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=8,
)  # fmt: skip


def _read(text: str) -> Any:
    """Read an answer by the rules of the guide: words, JSON strings, parentheses."""
    value, rest = _value(text)
    assert not rest
    return value


def _value(text: str) -> tuple[Any, str]:
    if text.startswith("("):
        items, text = [], text[1:]
        while not text.startswith(")"):
            item, text = _value(text.removeprefix(" "))
            items.append(item)
        return items, text[1:]
    if text.startswith('"'):
        value, end = json.JSONDecoder().raw_decode(text)
        return value, text[end:]
    end = min((text.index(c) for c in " )" if c in text), default=len(text))
    word, rest = text[:end], text[end:]
    if word.startswith("DOOR_"):
        return Atom(word), rest
    return {"T": True, "NIL": None}[word] if word in {"T", "NIL"} else json.loads(word), rest


def _as_read(value: Any) -> Any:
    """Return a value as an answer can say it: no, and none, are both NIL."""
    if isinstance(value, list):
        return [_as_read(each) for each in value]
    return None if value is False else value


@given(values)
def test_an_answer_is_one_visible_line_that_says_its_value(value: Any) -> None:
    """By a reader that knows nothing of the writer; numbers to the last digit."""
    text = text_of(value)

    assert text.isprintable()
    assert _as_read(value) == _read(text)


@given(anything)
def test_texts_of_others_are_one_visible_line_in_json_too(text: str) -> None:
    """Reasons, errors, and the id that a client gave."""
    line = read_line(b'{"ask": "GET_OPEN_DOOR", "id": 1}')

    answered = write_answer(line, Answer(None, text)).decode()
    refused = write_error(text, is_json=True, given_id=[text]).decode()
    plain = write_error(text).decode()

    for said in (answered, refused, plain):
        assert said[:-1].isprintable()
        assert said.endswith("\n")
    assert {"answer": None, "id": 1} | ({"reason": text} if text else {}) == json.loads(answered)
    assert {"error": text, "id": [text]} == json.loads(refused)
    assert text == problem_of(plain[:-1]) == problem_of(refused[:-1])


@given(st.lists(anything, min_size=1))
def test_words_are_read_as_they_were_written(words: list[str]) -> None:
    """Whatever is in them; blanks between, one or many."""
    line = "  \t ".join(map(as_word, words))

    assert line.replace("\t", "").isprintable()
    assert words == split_words(line)
    assert words == split_words(f" {line} ")


@given(st.binary())
def test_any_bytes_are_a_question_or_an_error_in_a_sentence(data: bytes) -> None:
    """Nothing else is raised, and the problem fits on a line."""
    try:
        read_line(data)
    except LineError as error:
        assert len(write_error(str(error))) < 1000


_WORDS = ["DOOR_OPEN", "WAIT_UNTIL", "BELIEVED", "AT", "DOOR_1", '"', '"a b"', "#" + 32 * "f", "{",
          "}", '"ask"', ":", "OPEN", "1e999", "nan", "\x00", "\\", "(", ")", "NEXT_DOOR", "[", "]",
          "HELP", "'", "\u200f", "é", ","]  # fmt: skip


@given(
    st.lists(st.sampled_from(_WORDS)).map(" ".join) | st.lists(st.sampled_from(_WORDS)).map("".join)
)
def test_lines_that_are_nearly_questions(text: str) -> None:
    """The same of lines that are made of what questions are made of."""
    try:
        read_line(text.encode())
    except LineError as error:
        assert str(error)


@given(st.recursive(st.none() | st.booleans() | st.floats() | anything | st.integers(),
                    lambda inner: st.lists(inner) | st.dictionaries(
                        st.sampled_from(["ask", "args", "at", "known_at", "command_id", "id"])
                        | anything, inner), max_leaves=20))  # fmt: skip
def test_any_json_is_a_question_or_an_error(value: Any) -> None:
    """Of every form, with the keys that count and others."""
    try:
        read_line(json.dumps(value).encode())
    except LineError as error:
        assert str(error)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (b"", "expected a question such as DOOR_OPEN DOOR [TIME], got none"),
        (b"   ", "got none"),
        (b"DOOR_AJAR DOOR_1", "'DOOR_AJAR' is no question. Did you mean DOOR_"),
        (b"door_open DOOR_1", "Did you mean DOOR_OPEN"),
        (b"DOOR_OPEN", "DOOR_OPEN DOOR [TIME]: expected DOOR, got nothing more"),
        (b'DOOR_OPEN ""', "expected a door such as DOOR_3, got ''"),
        (b"DOOR_OPEN DOOR_1 2h ago", "got 'ago' besides; what has blanks in it stands in quotes"),
        (b"DOOR_OPEN DOOR_1 AT now", "got 'now' besides"),
        (b"SET_DOOR_OPEN DOOR_1 now", "got 'now' besides"),
        (b"SET_OPEN_PROBABILITY DOOR_1 half", "expected a number, got 'half'"),
        (b"WAIT_UNTIL DOOR_1 AJAR 1", "expected one of UNKNOWN OPEN CLOSED MOVING OFFLINE"),
        (b"WAIT_UNTIL DOOR_1 OPEN nan", "expected 0 to 86,400 seconds, got 'nan'"),
        (b"WAIT_UNTIL DOOR_1 OPEN -1", "expected 0 to 86,400 seconds"),
        (b"WAIT_UNTIL DOOR_1 OPEN 1e9", "expected 0 to 86,400 seconds"),
        (b"BEST_TIME DOOR_1 MOVING", "expected OPEN or CLOSED, got MOVING"),
        (b"BELIEVED DOOR_OPEN DOOR_1 now", "expected a question, AT and a time"),
        (b"BELIEVED SET_DOOR_OPEN DOOR_1 AT now", "SET_DOOR_OPEN cannot be asked of what was"),
        (b"BELIEVED BELIEVED DOOR_OPEN DOOR_1 AT now AT now", "cannot be asked of what was known"),
        (b"BELIEVED PROBABILITY_DOOR_OPEN DOOR_1 AT now AT now", "cannot be asked of what was"),
        (b"PROBABILITY_DOOR_OPEN DOOR_1 AT", "expected a time behind AT"),
        (b"#12 SET_DOOR_OPEN DOOR_1", "expected a command id of 32 hexadecimal digits, got '12'"),
        (b"#" + 32 * b"a" + b" DOOR_OPEN DOOR_1", "only an action takes a command id"),
        (b'DOOR_OPEN "DOOR_1', "quotes around those with blanks"),
        (b'DOOR_OPEN "DOOR_1"x', "expected words with blanks between"),
        (b'DOOR_OPEN "\\x"', "is no JSON string"),
        (b"DOOR_OPEN DOOR_1\0", "control characters, got '\\x00' at 17"),
        (b"DOOR_OPEN DOOR_1\rSET_DOOR_OPEN DOOR_1", "control characters, got '\\r'"),
        (b"DOOR_OPEN \xff", "expected UTF-8 text, got byte 0xff at 11"),
        (b"x" * MOST_LINE_BYTES, "expected a line of at most 65,536 bytes"),
        (b"{", "expected one JSON object a line"),
        (b"{}", "'' is no question"),
        (b'{"ask": 1}', "1 is no question"),
        (b'{"ask": "DOOR_OPEN", "args": "DOOR_1"}', "args: expected a list"),
        (b'{"ask": "DOOR_OPEN", "args": [true]}', "args: expected a text or a number, got True"),
        (b'{"ask": "DOOR_OPEN", "args": [1.5]}', "expected a door such as DOOR_3, got 1.5"),
        (b'{"ask": "DOOR_OPEN", "args": [1], "at": 1.5}', "whole nanoseconds, got 1.5"),
        (b'{"ask": "DOOR_OPEN", "args": [1], "when": 1}', "key 'when': expected one of"),
        (b'{"ask": "DOOR_OPEN", "args": [NaN]}', "expected a finite number, got NaN"),
        (b'{"ask": "SET_DOOR_OPEN", "args": [1], "command_id": 5}', "32 hexadecimal digits, got 5"),
        (b'{"ask": "DOOR_OPEN", "args": [1], "ask": "DOOR_CLOSED"}', "key 'ask' is there twice"),
        (b"{" + b'"id":[' * 9000, "expected one JSON object"),
        (b"NEXT_DOOR " + b"DOOR_1 " * 1000, "expected at most 1,000 words, got more"),
        (b"NEXT_DOOR " + b'"a" ' * 16_000, "expected at most 1,000 words, got more"),
        (b'{"ask": "NEXT_DOOR", "args": [[1' + b",1" * 30_000 + b"]]}", "at most 1,000 words"),
        (b'{"ask": "NEXT_DOOR", "args": [1' + b",1" * 999 + b"]}", "at most 1,000 words"),
        (b"DOOR_OPEN " + b"x" * 1001, "words of at most 1,000 characters, got 1,001"),
        (b"x" * 60_000, "words of at most 1,000 characters, got 60,000"),
        (b"BELIEVED " * 300 + b"DOORS" + b" AT now" * 300, "BELIEVED cannot be asked of what was"),
        (b"BELIEVED " * 3000 + b"DOORS" + b" AT now" * 3000, "expected at most 1,000 words"),
        (b'{"ask": "DOORS", "id": "' + b"x" * 300 + b'"}', "id: expected at most 256 bytes"),
        (b'{"ask": "DOORS", "id": ' + b"[" * 900 + b"]" * 900 + b"}", "id: expected at most 256"),
    ],
)  # fmt: skip
def test_a_line_that_is_no_question_says_why(line: bytes, problem: str) -> None:
    """Where, what was expected, what was got."""
    with pytest.raises(LineError) as refused:
        read_line(line)

    assert problem in str(refused.value)
    assert refused.value.is_json == line.startswith(b"{")


def test_as_many_words_as_one_may_ask_by() -> None:
    """The doors of a large building; a command id is none of them."""
    doors = tuple(f"DOOR_{number}" for number in range(999))
    quoted = " ".join(f'"{door}"' for door in doors)

    assert doors == read_line(f"NEXT_DOOR {' '.join(doors)}".encode()).asked.doors
    assert doors == read_line(f"NEXT_DOOR {quoted}".encode()).asked.doors
    with pytest.raises(LineError, match="only an action takes a command id"):
        read_line(f"#{'a' * 32} NEXT_DOOR {quoted}".encode())


def test_an_error_in_json_has_the_id_of_its_question() -> None:
    """So that who asks many at a time knows which one it was."""
    with pytest.raises(LineError) as refused:
        read_line(b'{"id": {"n": 7}, "ask": "DOOR_AJAR"}')

    assert {"n": 7} == refused.value.given_id


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("DOOR_OPEN DOOR_3", {"args": ["DOOR_3"]}),
        ('DOOR_OPEN "main door" "2h ago"', {"args": ["main door"], "at": "2h ago"}),
        ("DOOR_OPEN DOOR_3 1700000000000000001", {"args": [3], "at": "1700000000000000001"}),
        ("BELIEVED DOOR_OPEN DOOR_3 AT now", {"args": ["DOOR_3"], "known_at": "now"}),
        ('BELIEVED DOOR_OPEN DOOR_3 "1h ago" AT now',
         {"args": ["DOOR_3"], "known_at": "now", "at": "1h ago"}),
    ],
)  # fmt: skip
def test_words_and_json_ask_the_same(text: str, asked: dict[str, Any]) -> None:
    """A door by its number, too; times as keys or behind the other words."""
    of_words = read_line(text.encode())
    of_json = read_line(json.dumps({"ask": "DOOR_OPEN", **asked}).encode())

    assert of_words.asked == of_json.asked
    assert of_words.asked == read_line(as_json_line(text).encode()).asked


def test_an_action_in_json_has_the_id_of_its_words() -> None:
    """The same command in either form."""
    words = f"#{bytes(range(16)).hex()} SET_OPEN_PROBABILITY DOOR_3 0.1"

    of_words, of_json = read_line(words.encode()), read_line(as_json_line(words).encode())

    assert bytes(range(16)) == of_words.asked.command_id
    assert of_words.asked == of_json.asked


def test_the_doors_of_next_door_may_be_a_list() -> None:
    """As a program has them."""
    asked = read_line(b'{"ask": "NEXT_DOOR", "args": [[1, "DOOR_2"], "AT", "now"]}').asked

    assert (("DOOR_1", "DOOR_2"), "now") == (asked.doors, asked.learnt_at)


def test_numbers_are_exact() -> None:
    """Not %f: a probability that was set is the one that is answered."""
    assert ["0.1", "1e-07", "0.30000000000000004"] == [
        text_of(value) for value in (0.1, 1e-7, 0.1 + 0.2)
    ]
    assert 5e-324 == float(text_of(math.ulp(0.0)))


def test_a_quoted_word_that_is_none_is_told_before_it_is_sent() -> None:
    """Where `ask --json` makes JSON of words."""
    with pytest.raises(QuestionError, match="quotes around"):
        as_json_line('DOOR_OPEN "DOOR_1')
