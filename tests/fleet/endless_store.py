"""A web server, or S3, that sends more than it may: without end, or more than it has said."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

HUGE, GIGABYTE = 100 * 10**9, 10**9
_BLANKS = b" " * 2**18
_BYTES_PER_S = 2.5e8


@dataclass(slots=True)
class Sent:
    """Where the server is, and how many bytes of bodies it has sent."""

    url: str
    bytes: int = 0
    requests: int = 0


class Answering(BaseHTTPRequestHandler):
    """A request that is answered by one of the functions below."""

    protocol_version = "HTTP/1.1"
    sent: Sent

    def start(self, status: int, length: int | None, **headers: str) -> None:
        """Send the head of an answer; without a length its body comes in chunks."""
        self.send_response(status)
        size = ("Transfer-Encoding", "chunked") if length is None else ("Content-Length", length)
        named = {"ETag": '"x"', "Last-Modified": "Mon, 02 Mar 2026 10:00:00 GMT"}
        for name, value in (size, *named.items(), *headers.items()):
            self.send_header(name.replace("_", "-"), str(value))
        self.end_headers()

    def send(self, data: bytes) -> None:
        self.wfile.write(data)
        self.sent.bytes += len(data)

    def send_without_end(self, *, in_chunks: bool = False) -> None:
        """Send until the client leaves, no faster than a fast network does."""
        if self.command != "HEAD":
            block = b"%x\r\n%b\r\n" % (len(_BLANKS), _BLANKS) if in_chunks else _BLANKS
            while True:
                self.send(block)
                time.sleep(len(block) / _BYTES_PER_S)

    @property
    def is_listing(self) -> bool:
        return self.command == "PROPFIND" or "list-type=2" in self.path

    def log_message(self, *_: object) -> None:
        pass


def all_huge(request: Answering) -> None:
    """Say that each object has 100 GB, and send them."""
    request.start(200, HUGE)
    request.send_without_end()


def small_by_head(request: Answering) -> None:
    """Say by HEAD that each has 4 kB."""
    request.start(200, 4096 if request.command == "HEAD" else HUGE)
    request.send_without_end()


def longer_ranges(request: Answering) -> None:
    """Say that the range comes that was asked for, of a GB, and send more."""
    named = request.headers.get("Range", "bytes=0-4095").removeprefix("bytes=")
    request.start(206, HUGE, Content_Range=f"bytes {named}/{GIGABYTE}")
    request.send_without_end()


def endless_errors(request: Answering) -> None:
    """Say at length that there is nothing."""
    request.start(404, None)
    request.send_without_end(in_chunks=True)


def endless_errors_after_a_cut(request: Answering) -> None:
    """End in the middle of an object; to who reads on from there, say at length that it is gone."""
    if "Range" in request.headers:
        endless_errors(request)
    elif request.command != "GET":
        request.start(404, 0)
    else:
        request.start(200, 8)
        request.send(b"1234")
        request.close_connection = True


def endless_lists(request: Answering) -> None:
    """Have no manifest, and list blanks."""
    if not request.is_listing:
        request.start(404, 0)
        return
    request.start(207 if request.command == "PROPFIND" else 200, None)
    request.send_without_end(in_chunks=True)


def endless_pages(request: Answering) -> None:
    """Have no manifest, and list a thousand objects, and a thousand more …"""
    if not request.is_listing:
        request.start(404, 0)
        return
    request.start(200, len(_PAGE))
    request.send(_PAGE)


_OBJECT = (
    "<Contents><Key>log/{:09}.mcap</Key><LastModified>2026-03-02T10:00:00.000Z</LastModified>"
    "<ETag>x</ETag><Size>10</Size></Contents>"
)
_PAGE = (
    "<ListBucketResult><IsTruncated>true</IsTruncated><NextContinuationToken>more"
    f"</NextContinuationToken>{''.join(map(_OBJECT.format, range(1000)))}</ListBucketResult>"
).encode()


@contextmanager
def endless_store(answer: Callable[[Answering], None]) -> Iterator[Sent]:
    """Serve at a port of this machine; each request gets that answer."""
    sent = Sent("")

    class Handler(Answering):
        def do_GET(self) -> None:
            sent.requests += 1
            try:
                answer(self)
            except ConnectionError:  # the client has had enough
                self.close_connection = True

        do_HEAD = do_PROPFIND = do_GET  # noqa: N815

    Handler.sent = sent
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        sent.url = f"http://127.0.0.1:{server.server_port}"
        threading.Thread(target=server.serve_forever, args=[0.02], daemon=True).start()
        try:
            yield sent
        finally:
            server.shutdown()
