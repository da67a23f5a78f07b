"""What other programs' planners rely on in the files that are made for them."""

from __future__ import annotations

from mutation.mutant import guard

PLANNER_FILES = (
    guard("pddl: names are told apart", "pddl_names.pddl_names",
          "bearers[name] == 1 and name not in used", "name not in used", "test_pddl"),
    guard("pddl: words of the language are no names", "pddl_names.pddl_names",
          "bearers[name] == 1 and name not in used", "bearers[name] == 1", "test_pddl"),
    guard("pddl: a name that is told apart is nobody else's", "pddl_names.pddl_names",
          "used |= set(plain.values())", "", "test_pddl"),
    guard("pddl: a name begins with a letter", "plain_name",
          "name if name[0].isalpha() else f'{wanted.kind}-{name}'", "name", "test_pddl"),
    guard("pddl: no text ends a comment", "pddl._quoted",
          r'json.dumps(text).replace("\x7f", "\\u007f")', "text", "test_pddl"),
    guard("pddl: a goal is one expression", "pddl._expression",
          "found is None or (said and (not depth))", "found is None", "test_pddl"),
    guard("pddl: a goal is closed", "pddl._expression",
          "at < len(text) or depth", "at < len(text)", "test_pddl"),
    guard("pddl: rooms of two levels", "rooms_between",
          "NamedRoom(door.level, names[1])", "NamedRoom(0, names[1])", "test_pddl"),
    guard("pddl: each door both ways round", "PddlProblem._facts",
          'f"    (door-between {name} {a} {b}) (door-between {name} {b} {a})"',
          'f"    (door-between {name} {a} {b})"', "test_pddl"),
    guard("pddl: what is nearly never open has a cost", "pass_cost",
          "max(p_open, LEAST_P)", "p_open", "test_pddl"),
    guard("pddl: likely by the moment that is asked for", "planning_problem._likely",
          "Moment(ns=door_map.moment_ns)", "None", "test_planning_problem"),
    guard("pddl: likely by what was known up to an event", "planning_problem._likely",
          "known_at = Moment(event=log.limit_of(scope))", "pass", "test_planning_problem"),
    guard("pddl: no domain over the problem", "_write_domain",
          "domain.resolve() == problem.resolve()", "False", "test_planning_problem"),
    guard("prolog: no module of others is replaced", "copy_file",
          "target.read_bytes() != shipped", "False", "test_prolog"),
)  # fmt: skip
