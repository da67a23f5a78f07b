"""What a robot can do at doors, as a PDDL domain: made to be read, and changed, by its user."""

from __future__ import annotations

import re

DOMAIN = "semmap-doors"

WORDS = frozenset(
    "door room robot-at door-between open closed other-state checked pass-cost pass "
    f"wait-and-pass try-and-pass check {DOMAIN} doors".split()
)
"""What means something in the domain: no object is called so."""

_HEAD = f"""\
; A robot, rooms, and the doors between them: the domain of the problems that
; `semmap-log export LOG problem.pddl` writes. Change it as you like.
(define (domain {DOMAIN})
  (:requirements :strips :typing{{costs}})
  (:types door room)
  (:predicates
    (robot-at ?r - room)
    (door-between ?d - door ?a ?b - room) ; both ways round
    (open ?d - door)                      ; its last known state; one of these three
    (closed ?d - door)
    (other-state ?d - door)               ; UNKNOWN, MOVING or OFFLINE
    (checked ?d - door))                  ; somebody was there and looked
"""

_FUNCTIONS = """\
  (:functions
    (total-cost) - number
    (pass-cost ?d - door) - number) ; -1000 ln P(open)
"""

_GO = """
  (:action {name} ; {why}
    :parameters (?d - door ?from ?to - room)
    :precondition (and (robot-at ?from) (door-between ?d ?from ?to) ({state} ?d))
    :effect (and (not (robot-at ?from)) (robot-at ?to) (checked ?d){then}
                 (increase (total-cost) (pass-cost ?d))))
"""

_CHECK = """
  (:action check ; look at it from either side
    :parameters (?d - door ?here ?there - room)
    :precondition (and (robot-at ?here) (door-between ?d ?here ?there))
    :effect (and (checked ?d) (increase (total-cost) 1)))
)
"""

_COST = re.compile(r"\n? *\(increase \(total-cost\) (?:\([^()]*\)|\d+)\)")


def dump_domain(*, with_costs: bool = True) -> str:
    """Return the domain's text.

    Args:
        with_costs: False: for planners that know STRIPS and types alone.
    """
    ways = (
        ("pass", "open", "as far as known it is open", ""),
        ("wait-and-pass", "closed", "somebody has to open it", " (not (closed ?d)) (open ?d)"),
        ("try-and-pass", "other-state", "it may be either",
         " (not (other-state ?d)) (open ?d)"),
    )  # fmt: skip
    actions = "".join(
        _GO.format(name=name, state=state, why=why, then=then) for name, state, why, then in ways
    )
    if with_costs:
        return f"{_HEAD.format(costs=' :action-costs')}{_FUNCTIONS}{actions}{_CHECK}"
    return _COST.sub("", f"{_HEAD.format(costs='')}{actions}{_CHECK}")
