"""Sends random terms to a kernel that echoes them, and prints which came back otherwise, as JSON.

python echo_client.py 300
"""

from __future__ import annotations

import json
import random
import sys

from semmap_log.oprs.expressions import Expression, Symbol, Term, read, write
from semmap_log.oprs.message_passer import PORT, PasserClient

LETTERS = '"\\()|;.,:!?$@#&~^%[]{}<>=+-*/ \t\näöü日本🙂aAzZ09_T'
WORDS = ["quit", "(quit)", "\\", '\\"', '"', "(/ 1 0)", "\n", "load", ";", "a\\", "$X", ".)", "||"]
FINISH_S = 60.0


def _text(random_: random.Random) -> str:
    if random_.random() < 0.5:
        return "".join(random_.choices(WORDS, k=random_.randrange(5)))
    return "".join(random_.choices(LETTERS, k=random_.randrange(12)))


def _term(random_: random.Random, depth: int = 0) -> Term:
    kind = random_.randrange(6 if depth < 3 else 4)
    if kind == 0:
        name = "".join(random_.choices("ABCxyz_09äü日 ", k=random_.randrange(1, 9)))
        return Symbol(f"A_{name}")
    if kind in {1, 2}:
        return _text(random_)
    if kind == 3:
        return random_.choice([0, 1, -1, 7, -(2**31), 2**31 - 1])
    return [_term(random_, depth + 1) for _ in range(random_.randrange(4))]


def _as_told(term: Term) -> Term:
    """Return what a kernel has of a term: names keep their bars, texts are as they were written."""
    return read(write(term))


def main() -> None:
    """Send, receive, compare."""
    count = int(sys.argv[1])
    random_ = random.Random(1)
    sent: dict[int, Term] = {}
    with PasserClient.connect("127.0.0.1", PORT, "PY") as client:
        for number in range(count):
            sent[number] = term = _term(random_)
            client.send("K1", Expression(Symbol("ECHO"), (number, term)))
        for number in range(count, count + 50):
            value = random_.choice([random_.random(), random_.lognormvariate(0, 50), -1e-7, 0.1])
            sent[number] = Symbol("T")
            said = Expression(Symbol("SAME"), (number, value, value))
            assert value == read(write(value))
            client.send("K1", said)
        lost, wrong = dict(sent), []
        while lost and (message := client.receive(FINISH_S)) is not None:
            got = read(message.text)
            assert isinstance(got, Expression)
            number, value = got.terms
            assert isinstance(number, int)
            del lost[number]
            if _as_told(sent[number]) != value:
                wrong.append([write(sent[number]), write(value)])
    sys.stdout.write(json.dumps({"lost": [write(term) for term in lost.values()], "wrong": wrong}))
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
