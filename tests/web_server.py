"""A plain web server that gives the files of a folder; it lists nothing, and knows no ranges."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path


@contextmanager
def web_server(folder: Path, asked: Counter[str] | None = None) -> Iterator[str]:
    """Serve a folder; hand out its URL. Methods that were asked for are counted."""

    class Handler(SimpleHTTPRequestHandler):
        def parse_request(self) -> bool:
            is_good = super().parse_request()
            if asked is not None:
                asked[self.command or ""] += 1
            return is_good

        def log_message(self, *_: object) -> None:
            pass

    handler = partial(Handler, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()  # else its thread looks at a closed socket, without rest
