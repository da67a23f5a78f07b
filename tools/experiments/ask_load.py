"""The server of questions under load: questions a second, actions, waits, memory.

    python tools/experiments/ask_load.py  500 doors; the log lies in the current folder
    python tools/experiments/ask_load.py --questions 20000

One client asks over a Unix socket, one question at a time, and checks each answer; then it sends
them ahead. Actions that last (`event`) are set beside `observe` in a Python program, on the same
disk. Then ten clients of another process flood the server with long lines and long questions, and
what one client waits for its answers is measured. The exit code is 1 if an answer is wrong, or
fewer questions a second than `--least` are answered.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import random
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import semmap_log as sl  # noqa: E402
from tests.live.ros.running import Running  # noqa: E402

LEAST_A_SECOND = 5000
AT_ONCE = 8
FLOODING = 10
MANY_CLIENTS = 200
WAITS = 100
HOUR_NS = 3600 * 10**9


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures; 0: all answers were right, and quick enough."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--doors", type=int, default=500)
    parser.add_argument("--questions", type=int, default=50_000)
    parser.add_argument("--actions", type=int, default=500)
    parser.add_argument("--flooded", type=int, default=500, help="questions beside floods")
    parser.add_argument("--least", type=int, default=LEAST_A_SECOND, help="questions a second")
    args = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(dir=".", prefix=".ask_load_") as name:
        load = Load(Path(name).absolute(), args.doors)
        print(f"{args.doors} doors")
        with load.server():
            rate = load.questions(args.questions)
            load.sent_ahead(args.questions)
            load.beside_changes(args.questions)
            load.past(200)
            load.beside_observe(args.actions)
            load.actions(args.actions)
            load.waits()
            load.memory()
            load.beside_floods(args.flooded)
        with load.server("--read-only"), sl.append(load.log) as writer:
            load.waits_of_a_follower(writer)
    if load.wrong:
        print(f"{load.wrong} answers were wrong")
    return int(load.wrong > 0 or rate < args.least)


class Client:
    """A connection; reads no more than it must."""

    def __init__(self, path: Path) -> None:
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(path))
        self._rest = b""

    def ask(self, line: bytes) -> bytes:
        self.socket.sendall(line)
        return self.line()

    def line(self) -> bytes:
        while b"\n" not in self._rest:
            self._rest += self.socket.recv(65536)
        line, _, self._rest = self._rest.partition(b"\n")
        return line


class Load:
    """A log, and what is measured of it."""

    def __init__(self, folder: Path, doors: int) -> None:
        self.log, self._path, self._doors = folder / "log", folder / "s", doors
        self._folder = folder
        self.wrong = 0
        self._dice = random.Random(1)
        self._states: dict[int, str] = {}
        with sl.create(self.log, tz="UTC", durability="none") as log:
            for door in range(1, doors + 1):
                self._states[door] = self._dice.choice(["OPEN", "CLOSED"])
                log.add_door(
                    x=float(door % 50), y=float(door // 50), theta=0.0, width=0.9,
                    state=self._states[door], prob_open=door / 1000, name=f"door_{door}",
                )  # fmt: skip

    @contextlib.contextmanager
    def server(self, *options: str) -> Iterator[None]:
        """Run one; its process is `self._process`."""
        command = [sys.executable, "-m", "semmap_log", "serve", str(self.log), *options,
                   "--ask", f"unix:{self._path}"]  # fmt: skip
        out, err = self._folder / "stdout", self._folder / "stderr"
        with out.open("wb") as stdout, err.open("wb") as stderr:
            self._process = subprocess.Popen(command, stdout=stdout, stderr=stderr)
        with Running(self._process, "serve", self._folder) as running:
            running.wait_for("questions are taken at")
            yield
            running.stop()

    def questions(self, count: int, what: str = "one client, one question at a time") -> float:
        """Ask one after the other; return how many a second."""
        asked, client = self._asked(count), Client(self._path)
        for line, _ in asked[:2000]:
            client.ask(line)
        seconds, begun = [], time.perf_counter()
        for line, expected in asked:
            sent = time.perf_counter()
            self.wrong += client.ask(line) != expected
            seconds.append(time.perf_counter() - sent)
        rate = count / (time.perf_counter() - begun)
        print(f"{what:37} {rate:9,.0f}/s   {_us(seconds)}")
        return rate

    def beside_changes(self, count: int) -> None:
        """Ask while another client sets a door, as fast as it can."""
        is_over, client = threading.Event(), Client(self._path)

        def change() -> None:
            while not is_over.is_set():
                share = self._dice.random()
                client.ask(f"SET_CLOSED_PROBABILITY DOOR_1 {share}\n".encode())

        changing = threading.Thread(target=change)
        changing.start()
        self.questions(count, "the same, beside actions of another")
        is_over.set()
        changing.join()

    def sent_ahead(self, count: int) -> None:
        """Send all, and take the answers as they come."""
        asked, client = self._asked(count), Client(self._path)
        data = b"".join(line for line, _ in asked)
        sending = threading.Thread(target=client.socket.sendall, args=[data])
        begun = time.perf_counter()
        sending.start()
        self.wrong += sum(client.line() != expected for _, expected in asked)
        print(
            f"one client, sent ahead                {count / (time.perf_counter() - begun):9,.0f}/s"
        )
        sending.join()

    def past(self, count: int) -> None:
        """Ask what was true at as many moments, each a replay; and of one that is remembered."""
        client, now_ns = Client(self._path), time.time_ns()
        for what, times in (
            ("of the past, each another moment", [now_ns - HOUR_NS - i for i in range(count)]),
            ("of the past, the same moment", [now_ns - HOUR_NS] * count),
        ):
            seconds = _timed(client.ask, [f"DOOR_OPEN DOOR_1 @{ns}\n".encode() for ns in times])
            print(f"{what:37} {count / sum(seconds):9,.0f}/s   {_us(seconds)}")

    def actions(self, count: int) -> None:
        """Set doors, eight clients at once: each answer is a commit on the disk."""
        parts = [_Setting(Client(self._path), 1 + i, count // AT_ONCE) for i in range(AT_ONCE)]
        begun = time.perf_counter()
        for each in parts:
            each.start()
        for each in parts:
            each.join()
        took_s = time.perf_counter() - begun
        seconds = [one for each in parts for one in each.seconds]
        self.wrong += sum(each.wrong for each in parts)
        print(f"actions of {AT_ONCE} clients at once          {len(seconds) / took_s:9,.0f}/s   "
              f"{_us(seconds)}")  # fmt: skip

    def beside_observe(self, count: int) -> None:
        """Set a door, and observe it in a log of this program, in turns: the disk is as busy."""
        client, asked, observed = Client(self._path), [], []
        with sl.create(self._folder / "own", tz="UTC") as log:
            log.add_door()
            for i in range(count):
                line = f"SET_OPEN_PROBABILITY DOOR_1 0.{i + 1:06}\n".encode()
                asked += _timed(client.ask, [line])
                observed += _timed(lambda state: log.observe(1, state), [("open", "closed")[i % 2]])
        print(f"actions of one client                 {count / sum(asked):9,.0f}/s   {_us(asked)}")
        print(f"observe in a Python program, in turns {count / sum(observed):9,.0f}/s   "
              f"{_us(observed)}")  # fmt: skip

    def waits(self) -> None:
        """Let one client wait for what another does."""
        waiting, acting = Client(self._path), Client(self._path)
        after_s, behind_s = [], []
        for i in range(WAITS):
            state = (b"OPEN", b"CLOSED")[i % 2]
            acting.ask(b"SET_DOOR_" + (b"CLOSED", b"OPEN")[i % 2] + b" DOOR_9\n")
            waiting.socket.sendall(b"WAIT_UNTIL DOOR_9 " + state + b" 60\n")
            time.sleep(0.002)
            begun = time.perf_counter()
            acting.socket.sendall(b"SET_DOOR_" + state + b" DOOR_9\n")
            self.wrong += waiting.line() != b"T"
            after_s.append(time.perf_counter() - begun)
            acting.line()
            behind_s.append(time.perf_counter() - begun)
        print(f"WAIT_UNTIL, from sending the action                {_us(after_s)}")
        print(f"the action's own answer                            {_us(behind_s)}")

    def waits_of_a_follower(self, writer: sl.DoorLogWriter) -> None:
        """Let a client of a read-only server wait for what this process writes."""
        client, seconds = Client(self._path), []
        for i in range(WAITS):
            state = ("open", "closed")[i % 2]
            writer.observe(9, ("closed", "open")[i % 2])
            before = f"WAIT_UNTIL DOOR_9 {('CLOSED', 'OPEN')[i % 2]} 60\n".encode()
            self.wrong += client.ask(before) != b"T"
            client.socket.sendall(f"WAIT_UNTIL DOOR_9 {state.upper()} 60\n".encode())
            time.sleep(0.002)
            begun = time.perf_counter()
            writer.observe(9, state)
            self.wrong += client.line() != b"T"
            seconds.append(time.perf_counter() - begun)
        print(f"WAIT_UNTIL, --read-only, from `observe`            {_us(seconds)}")

    def beside_floods(self, count: int) -> None:
        """Ask what is so, what was so, and what is likely, while ten clients flood the server."""
        client, now_ns = Client(self._path), time.time_ns()
        client.ask(b"NEXT_DOOR DOOR_1\n")  # from here on it has learnt
        for flooding in ("long lines", "long questions"):
            process = multiprocessing.get_context("spawn").Process(
                target=flood, args=(self._path, self._doors, flooding), daemon=True
            )
            process.start()
            time.sleep(3)  # until all of them are at it
            for what, line, times in (
                ("what is so", "DOOR_OPEN DOOR_1", count),
                ("what was so", "DOOR_OPEN DOOR_1 @{}", count),
                ("what is likely", "PROBABILITY_DOOR_OPEN DOOR_1 AT @{}", max(count // 5, 1)),
            ):
                lines = [f"{line.format(now_ns - i)}\n".encode() for i in range(times)]
                seconds = _timed(client.ask, lines)
                beside = f"{what}, beside {FLOODING} that flood with {flooding}"
                print(f"{beside:57} {_us(seconds)}")
            process.kill()
            process.join()

    def memory(self) -> None:
        """Print what the server's process holds, before and with many clients that have asked."""
        before = self._resident()
        clients = [Client(self._path) for _ in range(MANY_CLIENTS)]
        for each in clients:
            each.ask(b"DOORS\n")
        held = self._resident()
        print(f"memory: {before:.1f} MB; with {MANY_CLIENTS} clients more: {held:.1f} MB")

    def _resident(self) -> float:
        status = Path(f"/proc/{self._process.pid}/status").read_text(encoding="utf-8")
        (kilobytes,) = re.findall(r"VmRSS:\s+(\d+) kB", status)
        return int(kilobytes) / 1e3

    def _asked(self, count: int) -> list[tuple[bytes, bytes]]:
        """Return random questions about all doors, and their answers."""
        found = []
        for _ in range(count):
            door = self._dice.randrange(1, self._doors + 1)
            name = self._dice.choice(["DOOR_OPEN", "DOOR_CLOSED", "PROBABILITY_DOOR_OPEN"])
            state = "OPEN" if name == "DOOR_OPEN" else "CLOSED"
            answer = b"T" if self._states[door] == state else b"NIL"
            if name == "PROBABILITY_DOOR_OPEN":
                answer = repr(door / 1000).encode()
            found.append((f"{name} DOOR_{door}\n".encode(), answer))
        return found


class _Setting(threading.Thread):
    """Sets a door open and closed."""

    def __init__(self, client: Client, door: int, count: int) -> None:
        super().__init__()
        self._client, self._door, self._count = client, door, count
        self.seconds: list[float] = []
        self.wrong = 0

    def run(self) -> None:
        lines = [f"SET_OPEN_PROBABILITY DOOR_{self._door} 0.{i:06}\n".encode()
                 for i in range(1, self._count + 1)]  # fmt: skip
        self.seconds = _timed(self._ask, lines)

    def _ask(self, line: bytes) -> None:
        self.wrong += self._client.ask(line) != b"T"


def flood(path: Path, doors: int, what: str) -> None:
    """Ask without pause, by several clients: in a process of its own."""
    every = b" ".join(b"DOOR_%d" % door for door in range(1, min(doors, 900) + 1))
    keys = b",".join(b'"%d":0' % key for key in [*range(6000), 5999])
    lines = {
        "long lines": (
            b"NEXT_DOOR " + b"DOOR_1 " * 9000,
            b"{" + keys + b"}",
            b"BELIEVED " * 3000 + b"DOORS" + b" AT now" * 3000,
        ),
        "long questions": (b"NEXT_DOOR " + every, b"BEST_TIME DOOR_1", b"DOORS\n" * 9000),
    }[what]
    for place in range(FLOODING):
        line = lines[place % len(lines)] + b"\n"
        threading.Thread(target=_flood, args=(Client(path), line, place > 0)).start()


def _flood(client: Client, line: bytes, reads: bool) -> None:  # noqa: FBT001  of a thread
    """Send a line again and again, and take its answers or leave them."""
    with contextlib.suppress(OSError):
        while True:
            client.socket.sendall(line)
            for _ in range(line.count(b"\n") * reads):
                client.line()


def _timed(do: Callable[[object], object], things: Sequence[object]) -> list[float]:
    """Return how long each took."""
    seconds = []
    for each in things:
        begun = time.perf_counter()
        do(each)
        seconds.append(time.perf_counter() - begun)
    return seconds


def _us(seconds: Sequence[float]) -> str:
    ordered = sorted(seconds)
    half, most = (1e6 * ordered[int(share * (len(ordered) - 1))] for share in (0.5, 0.99))
    return f"p50 {half:8,.0f}  p99 {most:8,.0f} us"


if __name__ == "__main__":
    sys.exit(main())
