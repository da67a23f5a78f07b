"""Stores of logs, asked over http, that send more than they should, or nothing of use."""

from __future__ import annotations

import hashlib
import http.server
import json
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from fault_injection.forking import Child

Parts = Callable[[], Iterator[bytes]]


@contextmanager
def hostile_store(dice: random.Random) -> Iterator[tuple[str, str]]:
    """Serve a store on this machine; hand out the URL of a log in it, and what the store does."""
    what, size, parts = dice.choice(_WAYS)(dice)
    with _served(size, parts) as url:
        yield url, what


@contextmanager
def harmless_store() -> Iterator[str]:
    """Serve a store whose log has an empty manifest; hand out its URL."""
    with _served(*_whole(b"{}")) as url:
        yield url


@contextmanager
def _served(size: int, parts: Parts) -> Iterator[str]:
    """Serve a manifest from a process of its own: who measures has no threads, and can fork."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _store_of(size, parts))
    child = Child(lambda _: server.serve_forever())
    server.server_close()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/log"
    finally:
        child.kill()
        child.wait()


def _store_of(size: int, parts: Parts) -> type[http.server.BaseHTTPRequestHandler]:
    class Store(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
            pass

        def do_HEAD(self) -> None:
            self._answer(has_body=False)

        def do_GET(self) -> None:
            self._answer(has_body=True)

        def _answer(self, *, has_body: bool) -> None:
            is_there = self.path.endswith("manifest.json")
            self.send_response(200 if is_there else 404)
            self.send_header("Content-Length", str(size if is_there else 0))
            self.send_header("Last-Modified", "Wed, 21 Oct 2015 07:28:00 GMT")
            self.send_header("ETag", '"x"')
            self.end_headers()
            try:
                for part in parts() if is_there and has_body else ():
                    self.wfile.write(part)
            except OSError:
                self.close_connection = True

    return Store


def _whole(data: bytes) -> tuple[int, Parts]:
    return len(data), lambda: iter((data,))


def _endless(dice: random.Random) -> tuple[str, int, Parts]:
    size = dice.choice((10**9, 10**11, 2**63 - 1))
    part = dice.choice((b'{"a":1,' + b" " * 65_530, b"[" * 65_536, bytes(65_536)))
    return f"whose manifest has {size} bytes", size, lambda: (part for _ in range(20_000))


def _deep(dice: random.Random) -> tuple[str, int, Parts]:
    data = dice.choice((b"[", b'{"a":')) * dice.choice((10_000, 500_000))
    return f"whose manifest is deep: {data[:5]!r}", *_whole(data)


def _same_keys(_: random.Random) -> tuple[str, int, Parts]:
    keys = ",".join(f'"k{i}":0' for i in range(45_000))
    return "whose manifest has a key twice", *_whole(f'{{{keys},"k0":0}}'.encode())


def _huge_numbers(dice: random.Random) -> tuple[str, int, Parts]:
    huge = dice.choice((2**40, 2**62, 2**63 - 1))
    segment = {"name": "log_000000.mcap", "bytes": huge, "sha256": "0" * 64, "segment": 0,
               "last_segment": dice.choice((0, huge)), "first_event": 0, "hash_so_far": "0" * 64,
               "format_minor": 0, "others": {}, "head_end": dice.choice((100, huge)),
               "next_event": huge, "head": "0" * 64, "counts": {"4": huge},
               "recorded_ns": [0, huge], "happened_ns": [0, huge]}  # fmt: skip
    entries = {"format": 1, "version": 1, "log_id": "0" * 32, "timezone": "UTC", "building": "",
               "robot": "", "segments": [segment] * dice.choice((1, 5000)), "superseded": [],
               "generation": 0}  # fmt: skip
    digest = hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()
    data = json.dumps(entries | {"sha256": digest}).encode()
    return f"whose manifest tells of {huge} bytes and events", *_whole(data)


def _long_number(_: random.Random) -> tuple[str, int, Parts]:
    return "whose manifest is a long number", *_whole(b"9" * 3_000_000)


_WAYS = (_endless, _deep, _same_keys, _huge_numbers, _long_number)
