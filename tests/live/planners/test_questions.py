"""The table of questions: the thesis's twelve to the letter, and all of them in the guide."""

from __future__ import annotations

from doc_pages import ROOT

from semmap_log.live.planners.door_view import STATE_QUESTIONS
from semmap_log.live.planners.oracle import is_wait
from semmap_log.live.planners.parsed_questions import (
    BY_NAME,
    QUESTIONS,
    QuestionKind,
    Type,
    read_words,
    table,
)

THESIS = {
    "DOOR_STATE_KNOWN": ("predicate", "DOOR"),
    "DOOR_OPEN": ("predicate", "DOOR"),
    "DOOR_CLOSED": ("predicate", "DOOR"),
    "PROBABILITY_DOOR_OPEN": ("function", "DOOR"),
    "PROBABILITY_DOOR_CLOSED": ("function", "DOOR"),
    "GET_OPEN_DOOR": ("function", ""),
    "GET_CLOSED_DOOR": ("function", ""),
    "REMOVE_DOOR": ("action", "DOOR"),
    "SET_DOOR_OPEN": ("action", "DOOR"),
    "SET_DOOR_CLOSED": ("action", "DOOR"),
    "SET_OPEN_PROBABILITY": ("action", "DOOR NUMBER"),
    "SET_CLOSED_PROBABILITY": ("action", "DOOR NUMBER"),
}
"""Of 4.4.7; the VARIABLE that GET_… binds there is its answer here."""


def test_the_thesiss_are_there_to_the_letter() -> None:
    """Twelve names, what sort each is, and what it takes."""
    found = {
        each.name: (each.kind.value, " ".join(one.value for one in each.arguments))
        for each in QUESTIONS
        if each.is_the_thesiss
    }

    assert THESIS == found


def test_each_name_is_there_once() -> None:
    """And what only looks at doors is one of them."""
    assert len(QUESTIONS) == len(BY_NAME)
    assert set(STATE_QUESTIONS) < set(BY_NAME)


def test_a_question_is_asked_as_its_form_says() -> None:
    """The words that the table wants are enough for each."""
    words = {Type.DOOR: ["DOOR_1"], Type.DOORS: ["DOOR_1", "DOOR_2"], Type.STATE: ["OPEN"],
             Type.NUMBER: ["0.5"], Type.SECONDS: ["1"], Type.NAME: ["WHY"],
             Type.QUESTION: ["DOOR_OPEN", "DOOR_1"]}  # fmt: skip

    for each in QUESTIONS:
        given = [word for one in each.arguments for word in words[one]]
        asked = read_words([each.name, *given, *(["AT", "now"] if each.name == "BELIEVED" else [])])
        assert asked.question.name in {each.name, "DOOR_OPEN"}
        assert is_wait(asked) == (each.name == "WAIT_UNTIL")


def test_actions_are_what_sets_or_removes() -> None:
    """Nothing else is asked to be done."""
    actions = {each.name for each in QUESTIONS if each.kind is QuestionKind.ACTION}

    assert {name for name in BY_NAME if name.startswith(("SET_", "REMOVE_"))} == actions


def test_the_guide_has_the_table() -> None:
    """Else print `semmap_log.live.planners.parsed_questions.table()`."""
    page = (ROOT / "docs" / "guides" / "planners.md").read_text(encoding="utf-8")

    assert table() in page
