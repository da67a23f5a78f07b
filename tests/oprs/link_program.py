"""A link with one door that opens and closes, in a network of its own: `python link_program.py`."""

from __future__ import annotations

import itertools
import sys
import threading
import time

from semmap_log.oprs.expressions import Expression, Symbol, Term
from semmap_log.oprs.message_passer import PORT, PasserClient
from semmap_log.oprs.passer_link import LinkSettings, PasserLink

STATE, DOOR = Symbol("DOOR_STATE"), Symbol("DOOR_3")
STATES = itertools.cycle(["OPEN", "CLOSED"])


def _facts() -> list[Expression]:
    return [Expression(STATE, (DOOR, Symbol(next(STATES))))]


def _answer(question: Expression) -> Term:
    return ['a "b"\\', question]


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> None:
    """Run until killed."""
    link = PasserLink(
        lambda: PasserClient.connect("127.0.0.1", PORT, "SEMMAP"),
        LinkSettings("SEMMAP", ["K1", "K2"], _facts, _answer, _say),
        retry_s=0.2,
    )
    threading.Thread(target=link.run).start()
    while True:
        time.sleep(0.05)
        link.post(_facts())


if __name__ == "__main__":
    main()
