"""Reads PDDL as its grammar says, without any of our code."""

from __future__ import annotations

import re
from typing import Any


def expression_of(text: str) -> list[Any]:
    """Return the one expression of a file as nested lists; a comment ends with its line.

    Raises:
        AssertionError: There is none, or more than one.
    """
    bare = re.sub(r";[^\n]*", "", text)
    stack: list[list[Any]] = [[]]
    for token in re.findall(r"[()]|[^\s()]+", bare):
        if token == "(":
            stack.append([])
        elif token == ")":
            done = stack.pop()
            assert stack, "a ) too many"
            stack[-1].append(done)
        else:
            stack[-1].append(token)
    assert 1 == len(stack), "a ) is missing"
    (found,) = stack[0]
    return found
