"""S-expressions: what is written is read back the same, and what is hostile raises our error."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from semmap_log.errors import ExpressionError
from semmap_log.live.planners.kernels.s_expressions import (
    MOST_DEPTH,
    MOST_TEXT,
    Variable,
    flat,
    is_atom,
    read_expression,
    sendable,
    write_expression,
)
from semmap_log.live.planners.question_lines import Atom


def typed(value: Any) -> Any:
    """Return a value with its types: `Atom("a") == "a"`, `1 == 1.0`, `-0.0 == 0.0`."""
    if isinstance(value, (tuple, list)):
        return type(value).__name__, [typed(each) for each in value]
    return type(value).__name__, repr(value)


WORDS = st.text(max_size=40) | st.text('\\"\n()a', max_size=6)
TEXTS = WORDS.map(sendable)
ATOMS = st.one_of(
    st.text("ABCdef_09.-+*/<>=!?%'|üé你", min_size=1, max_size=12),
    st.sampled_from(["DOOR_3", "T", "NIL", "|main door|", "K1.7", "inf", "x-1"]),
).filter(is_atom).map(Atom)  # fmt: skip
NUMBERS = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.recursive(
    ATOMS | TEXTS | NUMBERS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.builds(lambda first, rest: (first, *rest), ATOMS, st.lists(inner, max_size=4)),
    ),
    max_leaves=20,
)
EXPRESSIONS = st.builds(lambda first, rest: (first, *rest), ATOMS, st.lists(VALUES, max_size=5))


@given(EXPRESSIONS)
def test_what_is_written_is_read_back_the_same(expression: tuple[Any, ...]) -> None:
    """Types, cases of letters, and floats to their last digit included."""
    text = write_expression(expression)

    assert typed(expression) == typed(read_expression(text))


@given(EXPRESSIONS)
def test_what_is_written_is_safe_for_a_kernel(expression: tuple[Any, ...]) -> None:
    """
    On one line, all visible; and a kernel's own way to see where a text ends, by the longest
    match, sees the same texts: none takes in what stands behind it.
    """
    text = write_expression(expression)

    assert text.isprintable()
    texts = [each for each in flat(expression) if type(each) is str]
    assert [_quoted(each) for each in texts] == _texts_of_a_kernel(text)


def _quoted(text: str) -> str:
    return write_expression((Atom("A"), text))[3:-1]


def _texts_of_a_kernel(text: str) -> list[str]:
    r"""Return the texts that flex finds by `\"([^"]|\\["])*\"`: each as long as it can be."""
    found, start = [], 0
    while (start := text.find('"', start)) >= 0:
        end = start
        while (quote := text.find('"', end + 1)) >= 0:
            end = quote
            if text[quote - 1] != "\\":
                break
        found.append(text[start : end + 1])
        start = end + 1
    return found


@given(WORDS)
@example('"\\')
def test_all_words_of_others_can_be_sent(words: str) -> None:
    """Whatever a name or a reason in a log is."""
    text = write_expression((Atom("ANSWER"), 1, [sendable(words), sendable(words)]))

    assert text.isprintable()
    assert _texts_of_a_kernel(text) == [_quoted(sendable(words))] * 2
    _, _, (one, other) = read_expression(text)  # type: ignore[misc]
    assert one == other == sendable(words)


@pytest.mark.parametrize(
    ("words", "sent"),
    [
        ("main door", "main door"),
        ('a "b" \\ c\n\t', 'a "b" \\ c\n\t'),
        ("a\\", "a\\ "),
        ("\x00\r\x1b\u200f\ud800", "\\u0000\\r\\u001b\\u200f\\ud800"),
        ("x" * MOST_TEXT, "x" * MOST_TEXT),
        ("x" * MOST_TEXT + "y", "x" * MOST_TEXT),
        ("x" * (MOST_TEXT - 1) + "\\", "x" * (MOST_TEXT - 1) + " "),
        ("\x00" * MOST_TEXT, ("\\u0000" * MOST_TEXT)[: MOST_TEXT - 1] + "…"),
    ],
)
def test_words_are_sent_as_they_are_or_visibly(words: str, sent: str) -> None:
    """What a kernel takes stays as it is."""
    assert sent == sendable(words)


@given(st.text() | st.text('()".;|\\ $@~&[]a1-+\n'))
def test_hostile_text_raises_our_error_or_is_read(text: str) -> None:
    try:
        found = read_expression(text)
    except ExpressionError:
        return
    assert isinstance(found, tuple)
    assert isinstance(found[0], Atom)


@given(EXPRESSIONS, st.data())
def test_half_an_expression_is_none(expression: tuple[Any, ...], data: st.DataObject) -> None:
    """Wherever it is cut."""
    text = write_expression(expression)
    cut = data.draw(st.integers(0, len(text) - 1))

    with pytest.raises(ExpressionError):
        read_expression(text[:cut])


@pytest.mark.parametrize(
    ("text", "expression"),
    [
        ("(ASK 17 (DOOR_OPEN DOOR_3))", (Atom("ASK"), 17, (Atom("DOOR_OPEN"), Atom("DOOR_3")))),
        ("(unknown K1)\n", (Atom("unknown"), Atom("K1"))),
        (r'(A "a \"b\" \\ c\q")', (Atom("A"), 'a "b" \\ cq')),
        ('(A "a\nb\\n")', (Atom("A"), "a\nb\n")),
        ("(A (. a (. .) b .))", (Atom("A"), [Atom("a"), [], Atom("b")])),
        ("(A -3 +3 -0.5 1.0e-7 5. 7l 8ll)", (Atom("A"), -3, 3, -0.5, 1e-7, 5.0, 7, 8)),
        ("(A -.5 nan -3a -)", (Atom("A"), *map(Atom, ["-.5", "nan", "-3a", "-"]))),
        ("(A |a b|)", (Atom("A"), Atom("|a b|"))),
        ("(A $X @y @@Z)", (Atom("A"), *map(Variable, ["$X", "@y", "@@Z"]))),
        ("(~ (A b))", (Atom("~"), (Atom("A"), Atom("b")))),
    ],
)
def test_reads_what_kernels_write(text: str, expression: tuple[Any, ...]) -> None:
    """As the note on kernels has it."""
    assert typed(expression) == typed(read_expression(text))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "expected an expression in parentheses, got the end"),
        ("A", "expected an expression in parentheses, got 'A'"),
        ("()", "expected an expression with an atom first"),
        ("(1 a)", "an atom first"),
        ("(. a .)", "expected an expression, not a list"),
        ("(A b", "at 5: expected a closing parenthesis, got the end"),
        ("(A (. b))", "the parenthesis that fits"),
        ("(A) (B)", "expected one expression"),
        ("(A 1e-3)", "expected an atom, a number"),
        ("(A 1a)", "expected an atom, a number"),
        ("(A .5)", "expected an atom, a number"),
        ('(A "b)', "expected an atom, a number"),
        ("(A 99999999999999999999)", "a whole number of 64 bits"),
        (f"(A {'9' * 5000})", "a whole number of 64 bits"),
        ("(A " * (MOST_DEPTH + 1), f"at most {MOST_DEPTH} expressions"),
    ],
)
def test_says_what_is_wrong_with_a_text(text: str, match: str) -> None:
    with pytest.raises(ExpressionError, match=re.escape(match)):
        read_expression(text)


DEEP: Any = (Atom("A"),)
for _ in range(MOST_DEPTH):
    DEEP = (Atom("A"), DEEP)


@pytest.mark.parametrize(
    "expression",
    [
        (),
        ("text", 1),
        (1,),
        [Atom("A")],
        (Atom("A"), True),
        (Atom("A"), None),
        (Atom("A"), math.nan),
        (Atom("A"), math.inf),
        (Atom("A"), 2**63),
        (Atom("A"), Variable("$X")),
        (Atom("A"), "a\\"),
        (Atom("A"), "a\x00b"),
        (Atom("A"), "a\rb"),
        (Atom("A"), "\ud800"),
        (Atom("A"), "x" * (MOST_TEXT + 1)),
        (Atom("A"), ()),
        (Atom("A"), ("/", 1, 0)),
        DEEP,
        *((Atom("A"), Atom(atom)) for atom in [
            "", "a b", "a\n", "(", 'a"', "3", "-3", "a;b", "|a", "|a\nb|", "||", "$X", "@X", "a:b",
            "do", "If", "a\\", "a[", "\x7f", "\u200f", "\xa0", ".5", "~", "+",
        ]),
    ],
)  # fmt: skip
def test_what_a_kernel_would_not_read_is_not_written(expression: Any) -> None:
    """Each of these is an error, or something else, to a kernel."""
    with pytest.raises(ExpressionError):
        write_expression(expression)


def test_numbers_as_kernels_read_them() -> None:
    """A dot in each float, and `ll` behind what needs more than 32 bits."""
    values = (Atom("A"), 1e22, 1e-7, 0.1 + 0.2, -0.0, 5.0, 2**31 - 1, 2**31, -(2**31) - 1)

    assert (
        "(A 1.0e+22 1.0e-07 0.30000000000000004 -0.0 5.0 2147483647 2147483648ll -2147483649ll)"
        == write_expression(values)
    )


def test_flat() -> None:
    """All that stands in values, in its order."""
    inner: Any = [Atom("a"), (Atom("b"), 1), [[2.5]]]

    assert [Atom("a"), Atom("b"), 1, 2.5, "c"] == flat([*inner, "c"])
