"""A door map for tests, as a program: answers the module's lines, keeps actions in a journal.

    python door_server.py ADDRESS JOURNAL [--hold N]

It has the doors 1 (open), 2 (closed) and 3 (unknown). An action is a line of the journal, synced
before it is answered. With --hold N the Nth action is stored, and never answered.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import socket
import socketserver
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path

WORD = re.compile(r'"(?:[^"\\]|\\.)*"|[^ ]+')
STATES = {"SET_DOOR_OPEN": "OPEN", "SET_DOOR_CLOSED": "CLOSED"}
PROBABILITIES = {"SET_OPEN_PROBABILITY": "OPEN", "SET_CLOSED_PROBABILITY": "CLOSED"}


@dataclass
class Doors:
    """The doors, what was done to them, and under which command id."""

    journal: Path
    hold: int = 0
    states: dict[str, str] = field(
        default_factory=lambda: {"DOOR_1": "OPEN", "DOOR_2": "CLOSED", "DOOR_3": "UNKNOWN"}
    )
    probabilities: dict[tuple[str, str], float] = field(default_factory=dict)
    done: dict[str, str] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        if self.journal.exists():
            for line in self.journal.read_text(encoding="utf-8").splitlines():
                command, *words = line.split(" ")
                self.done[command] = self._change(words)

    def answer(self, line: str) -> str | None:
        """Return the answer; None: there will never be one."""
        words = [json.loads(word) if word[0] == '"' else word for word in WORD.findall(line)]
        with self.lock:
            if words[0].startswith("#"):
                return self._act(words[0], words[1:])
            return self._ask(*words)

    def _act(self, command: str, words: list[str]) -> str | None:
        if command in self.done:
            return self.done[command]
        if words[1] not in self.states:
            return "NIL"
        with self.journal.open("a", encoding="utf-8") as journal:
            journal.write(" ".join([command, *words]) + "\n")
            journal.flush()
            os.fsync(journal.fileno())
        self.done[command] = self._change(words)
        return None if len(self.done) == self.hold else self.done[command]

    def _change(self, words: list[str]) -> str:
        action, door, *values = words
        if action in STATES:
            self.states[door] = STATES[action]
        elif action in PROBABILITIES:
            self.probabilities[door, PROBABILITIES[action]] = float(values[0])
        else:
            del self.states[door]
        return "T"

    def _ask(self, question: str, *words: str) -> str:
        door = words[0] if words else ""
        state = self.states.get(door)
        match question:
            case "DOOR_OPEN" | "DOOR_CLOSED":
                return "T" if state == question.removeprefix("DOOR_") else "NIL"
            case "DOOR_STATE_KNOWN":
                return "T" if state in {"OPEN", "CLOSED"} else "NIL"
            case "PROBABILITY_DOOR_OPEN" | "PROBABILITY_DOOR_CLOSED":
                found = self.probabilities.get((door, question.rpartition("_")[2]))
                return "NIL" if found is None else repr(found)
            case "GET_OPEN_DOOR" | "GET_CLOSED_DOOR":
                wanted = question.split("_")[1]
                return next((door for door, is_ in self.states.items() if is_ == wanted), "NIL")
            case "NEXT_DOOR":
                return next((door for door in words if self.states.get(door) == "OPEN"), "NIL")
            case "DOORS":
                return f"({' '.join(self.states)})"
            case "WHY":
                return json.dumps(f'{state}: "seen"\nby a laser (quit) \\ ü', ensure_ascii=False)
            case "TEXTS":
                return '("a\\\\" " (/ 1 0) " "\\\\" "why not")'
            case "ECHO":
                return json.dumps(list(words))[1:-1].replace(", ", " ").join("()")
            case _:
                return f"ERROR {json.dumps(f'no question {question}')}"


class Handler(socketserver.StreamRequestHandler):
    """One client."""

    def handle(self) -> None:
        """Answer line by line."""
        doors: Doors = self.server.doors  # type: ignore[attr-defined]
        for line in self.rfile:
            answer = doors.answer(line.decode().removesuffix("\n"))
            if answer is None:
                sys.stdout.write("stored, not answered\n")
                sys.stdout.flush()
                threading.Event().wait()
            self.wfile.write(f"{answer}\n".encode())


class Server(socketserver.ThreadingTCPServer):
    """Listens at unix:PATH or tcp:127.0.0.1:PORT."""

    daemon_threads = True
    request_queue_size = 128

    def __init__(self, address: str, doors: Doors) -> None:
        scheme, _, place = address.partition(":")
        if scheme == "unix":
            Path(place).unlink(missing_ok=True)
            self.address_family, where = socket.AF_UNIX, place
        else:
            host, _, port = place.rpartition(":")
            self.allow_reuse_address, where = True, (host, int(port))
        self.doors = doors
        super().__init__(where, Handler)  # type: ignore[arg-type]

    def get_request(self) -> tuple[socket.socket, object]:
        """Answer at once, also over TCP."""
        connection, client = super().get_request()
        if self.address_family == socket.AF_INET:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection, client


def main() -> None:
    """Serve until killed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("address")
    parser.add_argument("journal", type=Path)
    parser.add_argument("--hold", type=int, default=0)
    chosen = parser.parse_args()
    with Server(chosen.address, Doors(chosen.journal, chosen.hold)) as server:
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        server.serve_forever()


if __name__ == "__main__":
    sys.exit(main())
