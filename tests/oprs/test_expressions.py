"""Expressions as text and back; and what a kernel's own lexer makes of them."""

from __future__ import annotations

import math
import re
import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from semmap_log.oprs.expressions import (
    DEEPEST,
    NIL,
    Expression,
    ExpressionError,
    Symbol,
    Term,
    read,
    write,
)

D3 = Symbol("DOOR_3")

NAMES = st.text(st.characters(exclude_characters="|", exclude_categories=["C"]), min_size=1)
ATOMS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]*", fullmatch=True).map(Symbol) | NAMES.map(Symbol)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=30)
NUMBERS = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)


def _nested(terms: st.SearchStrategy[Term]) -> st.SearchStrategy[Term]:
    several = st.lists(terms, max_size=5)
    return several | st.builds(Expression, ATOMS, several.map(tuple))


TERMS = st.recursive(ATOMS | TEXTS | NUMBERS, _nested, max_leaves=20)


def _as_told(term: Term) -> Term:
    """Return what is left of a term: texts lose control characters, numbers never a digit."""
    if isinstance(term, Expression):
        return Expression(term.name, tuple(map(_as_told, term.terms)))
    if isinstance(term, list):
        return [_as_told(each) for each in term]
    if isinstance(term, str) and not isinstance(term, Symbol):
        told = re.sub(r"[\x00-\x08\x0b-\x1f\x7f]", " ", term)
        return f"{told} " if told.endswith("\\") else told
    return term


def _types(term: Term) -> object:
    if isinstance(term, Expression):
        return Expression, [_types(each) for each in term.terms]
    if isinstance(term, list):
        return list, [_types(each) for each in term]
    return type(term)


@pytest.mark.parametrize(
    ("term", "text"),
    [
        (Expression(Symbol("DOOR_STATE"), (D3, Symbol("OPEN"))), "(DOOR_STATE DOOR_3 OPEN)"),
        (Expression(Symbol("DOOR_PROBABILITY"), (D3, 0.75)), "(DOOR_PROBABILITY DOOR_3 0.75)"),
        (Expression(Symbol("QUIET")), "(QUIET)"),
        ([D3, [Symbol("NIL")], []], "(. DOOR_3 (. NIL .) (. .) .)"),
        ('seen by "a laser"', '"seen by \\"a laser\\""'),
        ("a\\b\n\tc", '"a\\\\b\\n\\tc"'),
        (Symbol("main door"), "|main door|"),
        (Symbol("Tür_1"), "Tür_1"),
        (Symbol("3rd"), "|3rd|"),
        (0.1 + 0.2, "0.30000000000000004"),
        (1e-7, "1.0e-07"),
        (-1.5e300, "-1.5e+300"),
        (5e-324, "5.0e-324"),
        (0.5, "0.5"),
        (-0.0, "-0.0"),
        (2**31 - 1, "2147483647"),
        (2**31, "2147483648ll"),
        (-(2**63), "-9223372036854775808ll"),
    ],
)
def test_terms_and_their_texts(term: Term, text: str) -> None:
    """
    Written as they stand here, and read back.
    """
    assert text == write(term)
    assert term == read(text)
    assert _types(term) == _types(read(text))


@given(TERMS)
def test_what_is_written_is_read(term: Term) -> None:
    """
    Any term, to its type; a float to its last bit.
    """
    told = read(write(term))

    assert _as_told(term) == told
    assert _types(term) == _types(told)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_floats_to_the_last_bit(number: float) -> None:
    """
    In the form that a kernel reads: digits, a point, digits, an exponent.
    """
    text = write(number)

    assert re.fullmatch(r"-?[0-9]+\.[0-9]+(e[-+][0-9]+)?", text)
    read_back = read(text)
    assert isinstance(read_back, float)
    assert struct.pack(">d", number) == struct.pack(">d", read_back)


QUOTED = re.compile(r'"(?:\\"|[^"])*"')
"""A text as a kernel's lexer finds it, in src/lex-macro.l.part: the longest match, in which a
backslash may stand alone."""


@given(st.lists(TEXTS, min_size=1, max_size=4))
@example(["a\\", " (/ 1 0) "])
@example(["\\\\", '"', "\\"])
def test_no_text_breaks_out_of_its_quotes(texts: list[str]) -> None:
    """
    A kernel finds as many texts as there are, and between them nothing but blanks: what somebody
    wrote as a reason is never a term, least of all one that is evaluated.
    """
    line = write(Expression(Symbol("REASONS"), tuple(texts)))

    assert not re.search(r"[\x00-\x1f\x7f]", line)
    found = QUOTED.findall(line)
    assert [_as_told(text) for text in texts] == [read(each) for each in found]
    assert f"(REASONS{' ' * len(texts)})" == QUOTED.sub("", line)


@given(TERMS)
def test_one_line_of_one_expression(term: Term) -> None:
    """
    Outside of texts and bars there is no control character, and each parenthesis has its other.
    """
    line = write(Expression(Symbol("FACT"), (term,)))

    assert line.isprintable() or not re.search(r"[\x00-\x1f\x7f]", line)
    bare = re.sub(r"\|[^|]+\|", "x", QUOTED.sub("x", line))
    assert bare.count("(") == bare.count(")")
    assert ";" not in bare


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none(number: float) -> None:
    """
    A kernel would take them for names.
    """
    assert NIL == write(number)


@pytest.mark.parametrize(
    "term",
    [
        Symbol(""),
        Symbol("a|b"),
        Symbol("a\nb"),
        Symbol("\0"),
        2**63,
        -(2**63) - 1,
        Expression(Symbol("a|")),
    ],
)
def test_what_no_kernel_reads_is_not_written(term: Term) -> None:
    """
    Rather than to be told something else.
    """
    with pytest.raises(ExpressionError, match="expected"):
        write(term)


def test_lists_that_are_nested_too_deep() -> None:
    """
    Neither written nor read, long before Python's own limit.
    """
    term: Term = []
    for _ in range(DEEPEST):
        term = [term]
    assert term == read(write(term))

    with pytest.raises(ExpressionError, match="at most 64 lists in each other"):
        write([term])
    for text in ("(. " * 10_000, "(f " * 10_000, "(" * 10_000):
        with pytest.raises(ExpressionError, match="at most 64 lists in each other"):
            read(text)


@pytest.mark.parametrize(
    ("text", "term"),
    [
        ("(.DOOR_2 DOOR_1 .)", [Symbol("DOOR_2"), Symbol("DOOR_1")]),
        ("(f 0.750000)", Expression(Symbol("f"), (0.75,))),
        ("( f\n  5. -3 +7 7ll 1e3 )",
         Expression(Symbol("f"), (5.0, -3, 7, 7, Symbol("1e3")))),
        ('"two\nlines"', "two\nlines"),
        ('"\\q\\n"', "q\n"),
        (" (| a b |)", Expression(Symbol(" a b "))),
        ("(~ (OPEN DOOR_3))", Expression(Symbol("~"), (Expression(Symbol("OPEN"), (D3,)),))),
    ],
)  # fmt: skip
def test_what_kernels_write_is_read(text: str, term: Term) -> None:
    """
    Their lists have no blank in front, their floats six digits, their texts line ends.
    """
    assert term == read(text)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "character 1: expected a term, got the end"),
        ("(f", "expected a term, got the end"),
        ("(f DOOR_3", "expected a term, got the end"),
        ("(f))", "character 4: expected nothing behind the expression, got '\\)'"),
        ("(f) (g)", "expected nothing behind the expression"),
        ("f g", "expected nothing behind the expression"),
        (")", "character 1: expected a term, got '\\)'"),
        ("(. a )", "expected a term, got '\\)'"),
        ("(f a .)", "expected a term, got '.\\)'"),
        ("()", "expected a term"),
        ("(3 4)", "expected a name behind it"),
        ('("f")', "expected a name behind it"),
        ('(f "a', "expected a term"),
        ('"a\\"', "expected a term"),
        ("|a", "expected a term"),
        ("||", "expected a term"),
    ],
)
def test_what_is_no_expression_is_refused(text: str, problem: str) -> None:
    """
    It says where, and what was expected.
    """
    with pytest.raises(ExpressionError, match=problem):
        read(text)


@given(st.text() | st.text('(). "\\|ab1-'))
def test_any_text_is_read_or_refused(text: str) -> None:
    """
    And what is read can be written, unless it holds a number that is too long.
    """
    try:
        term = read(text)
    except ExpressionError:
        return
    try:
        line = write(term)
    except ExpressionError:
        return
    assert _as_told(term) == read(line)
