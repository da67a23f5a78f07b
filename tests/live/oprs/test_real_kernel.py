"""The module in a real OpenPRS kernel; skipped where SEMMAP_OPRS does not name one."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from build_oprs_module import build_module, find_oprs

from tests.live.oprs.building import MODULE
from tests.live.oprs.workshop import PLANS, Workshop
from tests.live.ros.network_namespace import NetworkNamespace, NoNamespaceError
from tests.live.ros.running import DEADLINE_S, Running

pytestmark = pytest.mark.slow

TRACES = [
    "all", "text", "graphic", "intend", "suc_fail", "intention failure",
    "intention failure variable", "send", "receive", "fact", "goal", "db", "conclude",
    "db frame", "load op", "relevant op", "applicable op",
    *(f"user {one}" for one in ("trace", "op", "intend", "suc_fail", "send", "receive", "fact",
                                "goal", "relevant op", "applicable op")),
]  # fmt: skip
"""All that a kernel's grammar knows, but those of single plans."""


def _said(kernel: Running) -> list[str]:
    """Return the lines of a kernel's plans."""
    return re.findall(r"^\([A-Z_]+(?: [^\n]*)?\)$", kernel.output, re.MULTILINE)


def _consulted(workshop: Workshop, *questions: str) -> list[str]:
    kernel = workshop.kernel(*(f"consult {question}" for question in questions), "quit")
    kernel.process.wait(DEADLINE_S)
    return re.findall(r"gives the following result:\n(.*)", kernel.output)


def test_the_twelve_from_a_plan(workshop: Workshop) -> None:
    """Predicates as tests, functions in them, actions as goals; what is refused fails its goal."""
    workshop.serve()

    kernel = workshop.kernel("add (! (THE_TWELVE))")
    kernel.wait_for(r"^\(TWELVE DONE\)")

    assert [
        "(NOT_KNOWN)", "(NOT_OPEN)", "(NO_P)", "(FOUND DOOR_1 DOOR_2)", "(REMOVED)", "(TRIED NIL)",
        "(TWELVE DONE)",
    ] == _said(kernel)  # fmt: skip
    assert [
        "SET_DOOR_CLOSED DOOR_3", "SET_DOOR_OPEN DOOR_3", "SET_OPEN_PROBABILITY DOOR_3 0.1",
        "SET_CLOSED_PROBABILITY DOOR_3 0.30000000000000004", "REMOVE_DOOR DOOR_3",
    ] == workshop.actions()  # fmt: skip
    assert "FAILURE" not in kernel.output


def test_predicates_and_functions_from_consult(workshop: Workshop) -> None:
    """What a person types at a kernel."""
    workshop.serve()
    questions = {
        "(DOOR_OPEN DOOR_1)": "(DOOR_OPEN DOOR_1)",
        "(DOOR_OPEN DOOR_2)": "NULL",
        "(DOOR_OPEN DOOR_77)": "NULL",
        "(DOOR_CLOSED DOOR_2)": "(DOOR_CLOSED DOOR_2)",
        "(DOOR_STATE_KNOWN DOOR_2)": "(DOOR_STATE_KNOWN DOOR_2)",
        "(~ (DOOR_STATE_KNOWN DOOR_3))": "(~ (DOOR_STATE_KNOWN DOOR_3))",
        "(= NIL (PROBABILITY_DOOR_OPEN DOOR_1))": "(= NIL (PROBABILITY_DOOR_OPEN DOOR_1))",
        "(= NIL (PROBABILITY_DOOR_CLOSED DOOR_9))": "(= NIL (PROBABILITY_DOOR_CLOSED DOOR_9))",
        "(= T (GET_OPEN_DOOR $X))": "(= T (GET_OPEN_DOOR {$X->DOOR_1}))",
        "(= T (GET_CLOSED_DOOR $X))": "(= T (GET_CLOSED_DOOR {$X->DOOR_2}))",
        "(= DOOR_1 (GET_OPEN_DOOR))": "(= DOOR_1 (GET_OPEN_DOOR))",
        "(= DOOR_2 (GET_OPEN_DOOR))": "NULL",
        "(& (ANY_OPEN_DOOR $X) (DOOR_OPEN $X))":
            "(& (ANY_OPEN_DOOR {$X->NULL}) (DOOR_OPEN {$X->NULL}))",
        "(& (ANY_OPEN_DOOR $X) (DOOR_CLOSED $X))": "NULL",
        "(DOOR_OPEN $X)": "NULL",
        "(DOOR_OPEN 7)": "NULL",
        "(DOOR_OPEN (. DOOR_1 .))": "(DOOR_OPEN (.DOOR_1 .))",
        "(DOOR_MAP_ANSWERS)": "(DOOR_MAP_ANSWERS)",
    }  # fmt: skip

    assert list(questions.values()) == _consulted(workshop, *questions)


def test_variables(workshop: Workshop) -> None:
    """The thesis's function binds for good; the predicate's binding goes where the goal fails."""
    workshop.serve()

    kernel = workshop.kernel("add (! (VARIABLES))")
    kernel.wait_for(r"^\(VARIABLES DONE\)")

    assert [
        "(A STAYS DOOR_1)", "(B UNDONE)", "(C DOOR_1)", "(D DOOR_2)", "(D CLOSED)", "(E DOOR_1)",
        "(F DOOR_1 (.DOOR_1 DOOR_2 DOOR_3 .))", "(VARIABLES DONE)",
    ] == _said(kernel)  # fmt: skip


def test_ten_thousand_questions(workshop: Workshop) -> None:
    """One plan asks them in a row."""
    workshop.serve()

    workshop.kernel("add (! (MANY 10000))").wait_for(r"^\(ASKED 10000\)")


def test_two_kernels_at_once(workshop: Workshop) -> None:
    """Each sees what it stored itself; all is stored, once."""
    workshop.serve()

    kernels = [workshop.kernel(f"add (! (MANY_ACTIONS DOOR_{n} 100))") for n in (1, 2)]
    for number, kernel in enumerate(kernels, start=1):
        kernel.wait_for(rf"^\(ACTED DOOR_{number}\)")

    assert 400 == len(workshop.actions())


def test_all_traces_on(workshop: Workshop) -> None:
    """Where the thesis's kernel always hung."""
    workshop.serve()
    traces = [f"trace {trace} on" for trace in TRACES]
    traces += [f'trace {kind} opf "{PLANS}" on' for kind in ("text", "graphic")]

    kernel = workshop.kernel(*traces, "add (! (MANY_ACTIONS DOOR_1 50))")
    kernel.wait_for(r"^.*\(ACTED DOOR_1\)")

    assert 100 == len(workshop.actions())
    assert "syntax error" not in (kernel.output + kernel.errors).lower()
    assert len(kernel.output) > 20_000


@pytest.mark.parametrize("how", ["killed", "silent"])
def test_an_action_without_an_answer_is_stored_once(workshop: Workshop, how: str) -> None:
    """The server is killed between storing and answering, or is silent until the time-out."""
    first = workshop.serve("--hold", "1")
    kernel = workshop.kernel(
        "add (! (ONCE DOOR_3))", timeout_ms=60_000 if how == "killed" else 3000
    )
    first.wait_for("^stored, not answered$")
    if how == "killed":
        first.process.kill()
        first.process.wait(DEADLINE_S)
    kernel.wait_for(r"^\(ANSWER NIL\)")
    if how == "killed":
        workshop.serve()

    kernel.wait_for(r"^\(ONCE DONE\)")

    assert ["(ANSWER NIL)", "(REPEATED T)", "(ONCE DONE)"] == _said(kernel)
    assert ["SET_DOOR_OPEN DOOR_3"] == workshop.actions()


def test_a_plan_waits_for_a_door(workshop: Workshop) -> None:
    """By the kernel's own (^ ...): nothing else of the kernel waits meanwhile."""
    workshop.serve()
    waiting = workshop.kernel("add (! (WAIT_CLOSED DOOR_1))", "add (! (MANY_ACTIONS DOOR_2 20))")
    waiting.wait_for(r"^\(WAITS DOOR_1\)")
    waiting.wait_for(r"^\(ACTED DOOR_2\)")
    assert "(IS_CLOSED DOOR_1)" not in _said(waiting)

    workshop.kernel("add (! (SET_DOOR_CLOSED DOOR_1))")

    waiting.wait_for(r"^\(IS_CLOSED DOOR_1\)")


def test_a_map_that_is_not_there(workshop: Workshop) -> None:
    """Predicates are false, functions NIL."""
    questions = ["(DOOR_OPEN DOOR_1)", "(DOOR_MAP_ANSWERS)", "(= NIL (GET_OPEN_DOOR))"]

    assert ["NULL", "NULL", questions[2]] == _consulted(workshop, *questions)


def test_words_of_other_people_stay_words(workshop: Workshop) -> None:
    """A reason with quotes, a line's end and a kernel's command in it: printed, kept as a fact."""
    workshop.serve()

    kernel = workshop.kernel("add (! (WORDS))")
    kernel.wait_for(r"^\(WORDS DONE\)")

    assert '(BECAUSE OPEN: "seen" by a laser (quit) \\ ü)' in kernel.output
    assert not kernel.is_over


def test_it_loads_without_a_warning(workshop: Workshop) -> None:
    """A kernel warns of each name that it has not heard of."""
    kernel = workshop.kernel()
    kernel.wait_for("^semantic_map_oprs is there")

    ours = kernel.output.partition(str(PLANS))[0]
    assert "Finish loading external code: SUCCESS" in ours
    assert "WARNING" not in ours


def test_a_kernel_without_the_module_ends(workshop: Workshop) -> None:
    """It would take each door for not open: the include file lets it end, and say why."""
    bad = workshop.folder / "bad.inc"
    text = workshop.oprs.include.read_text(encoding="utf-8")
    bad.write_text(text.replace('/semantic_map_oprs"', '/nothing"'), encoding="utf-8")

    kernel = workshop.kernel(include=bad)

    kernel.process.wait(DEADLINE_S)
    assert "Finish loading external code: FAILURE" in kernel.output
    assert "semantic_map_oprs is not loaded" in kernel.output


def test_a_module_that_misses_a_function_of_the_kernel_is_refused(
    workshop: Workshop, tmp_path: Path
) -> None:
    """When it is loaded, not in the middle of a plan."""
    source = tmp_path / "more.c"
    source.write_text(
        "void not_of_this_kernel(void);\nvoid semmap_more(void);\n"
        "void semmap_more(void) { not_of_this_kernel(); }\n",
        encoding="utf-8",
    )
    subprocess.run(["cc", "-fPIC", "-c", source, "-o", tmp_path / "more.o"], check=True)
    (tmp_path / "bad").mkdir()
    include = build_module(find_oprs(), tmp_path / "bad", f"LDFLAGS={tmp_path}/more.o")

    kernel = workshop.kernel(include=include)

    kernel.process.wait(DEADLINE_S)
    assert "Finish loading external code: FAILURE" in kernel.output


@pytest.mark.parametrize("fold", ["lower", "upper"])
def test_a_kernel_that_folds_case_is_told(workshop: Workshop, fold: str) -> None:
    """It would ask for door_1, which no door is called."""
    kernel = workshop.kernel("quit", fold=fold)

    kernel.process.wait(DEADLINE_S)
    assert "start it with -l none" in kernel.errors


def test_the_plans_to_copy(workshop: Workshop) -> None:
    """
    Those that the guide shows: a sighting stored, a door chosen, a door waited for, in vain too.
    """
    workshop.serve()

    kernel = workshop.kernel(
        f'load opf "{MODULE / "example.opf"}"',
        "add (! (CHOOSE_DOOR (. DOOR_2 DOOR_1 .)))",
        "add (! (CHOOSE_DOOR (. DOOR_77 .)))",
        "add (! (WAIT_AT DOOR_2 60))",
        "add (! (WAIT_AT DOOR_77 1))",
        "add (DOOR_SEEN DOOR_2 OPEN)",
        "add (DOOR_SEEN DOOR_77 OPEN)",
    )
    for line in ("GO_TO DOOR_[12] ", "NO_DOOR ", "OPEN_NOW DOOR_2", "STILL_NOT_OPEN DOOR_77"):
        kernel.wait_for(rf"^\({line}")

    assert ["SET_DOOR_OPEN DOOR_2"] == workshop.actions()


def test_words_stay_words_in_another_kernel(workshop: Workshop) -> None:
    """Reasons that one kernel sends to another, over a message passer in a network of their own."""
    try:
        network = NetworkNamespace.open()
    except NoNamespaceError as error:
        pytest.skip(str(error))
    workshop.stack.callback(network.close)
    workshop.serve()
    passer = workshop.oprs.program.with_name("mp-oprs")
    if not passer.is_file():
        pytest.skip(f"no {passer}")
    plans = workshop.folder / "two.opf"
    plans.write_text(
        "((defop SEND :invocation (! (SEND-MESSAGE $TO $M)) :action (SEND-MESSAGE $TO $M))\n"
        "(defop TELL :invocation (! (TELL)) :body ((! (= $WHY (WHY DOOR_1)))\n"
        "  (! (= $TEXTS (ASK_DOOR_MAP TEXTS)))\n"
        "  (! (SEND-MESSAGE K2 (TEXTS $TEXTS)))\n"
        "  (! (SEND-MESSAGE K2 (REASON $WHY)))))\n"
        "(defop TEXTS :invocation (TEXTS $L) :body ((! (= $MINE (ASK_DOOR_MAP TEXTS)))\n"
        "  (IF (? (EQUAL $L $MINE)) (! (SAY (SAME_TEXTS))) ELSE (! (SAY (OTHER $L))))))\n"
        "(defop TOLD :invocation (REASON $R) :body ((! (= $WHY (WHY DOOR_1)))\n"
        "  (IF (? (= $R $WHY)) (! (SAY (SAME $R))) ELSE (! (SAY (OTHER $R)))))))\n",
        encoding="utf-8",
    )
    workshop.run(network.inside([str(passer), "-j", "3300"])).wait_for("Message passer running")

    kernels = []
    for name, commands in (("K2", []), ("K1", ["-c", "add (! (TELL))"])):
        words = [workshop.oprs.program, "-a", "-q", "-l", "none", "-m", "127.0.0.1", "-j", "3300",
                 "-n", name, "-x", workshop.oprs.include]  # fmt: skip
        for path in (PLANS, plans):
            words += ["-c", f'load opf "{path}"']
        inside = network.inside([str(word) for word in [*words, *commands]])
        kernels.append(workshop.run(inside, SEMMAP_ASK=workshop.address))
        kernels[-1].wait_for("^semantic_map_oprs is there")

    kernels[0].wait_for(r'^\(SAME OPEN: "seen" by a laser \(quit\) \\ ü\)')
    kernels[0].wait_for(r"^\(SAME_TEXTS\)")
    assert not kernels[0].is_over
