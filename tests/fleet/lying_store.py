"""A server of our own that speaks enough S3 to be read, and lies or fails as it is told."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath

Answer = tuple[int, bytes, int]
"""Status, body, and how many bytes of it are said to come."""
Lie = Callable[[int, Answer], Answer]
"""Takes the number of the request, from 0, and the honest answer; returns what is sent."""


def honest(_: int, answer: Answer) -> Answer:
    return answer


@contextmanager
def lying_store(folder: Path, lie: Lie) -> Iterator[dict[str, str]]:
    """Serve the files of a folder as `s3://bucket/NAME`; hand out the environment for it."""
    counted = iter(range(10**9))

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            name = unquote(urlsplit(self.path).path).rsplit("/", 1)[-1]
            path = folder / name
            if not name or not path.is_file():
                self._send((404, b"<Error><Code>NoSuchKey</Code></Error>", -1), {})
                return
            data = path.read_bytes()
            tag = f'"{hashlib.md5(data, usedforsecurity=False).hexdigest()}"'
            headers = {"ETag": tag, "Last-Modified": "Mon, 02 Mar 2026 10:00:00 GMT"}
            status, body = 200, data
            if said := self.headers.get("Range"):
                first, _, last = said.removeprefix("bytes=").partition("-")
                status, body = 206, data[int(first) : int(last) + 1]
                headers["Content-Range"] = f"bytes {first}-{last}/{len(data)}"
            self._send(lie(next(counted), (status, body, len(body))), headers)

        do_HEAD = do_GET  # noqa: N815

        def _send(self, answer: Answer, headers: dict[str, str]) -> None:
            status, body, said = answer
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(body) if said < 0 else said))
            self.end_headers()
            if self.command != "HEAD":
                with suppress(ConnectionError):  # who had asked is gone
                    self.wfile.write(body)
            if len(body) < said:
                self.close_connection = True

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield {
                "AWS_ENDPOINT_URL": f"http://127.0.0.1:{server.server_port}",
                "AWS_ACCESS_KEY_ID": "a" * 8,
                "AWS_SECRET_ACCESS_KEY": "b" * 8,
                "AWS_REGION": "us-east-1",
            }
        finally:
            server.shutdown()  # else its thread looks at a closed socket, without rest


def objects_below(url: str, folder: Path) -> Path:
    """Copy the objects right below a URL into a new folder, for `lying_store`; return it."""
    store = ObjectStore(UrlPath(url))
    folder.mkdir()
    for each in store.list():
        got = store.whole(each.name, most_bytes=2**24)
        assert got is not None
        (folder / each.name).write_bytes(got[0])
    return folder
