"""A bucket of an S3 server that runs for the tests: moto's, which honours conditional writes."""

from __future__ import annotations

import logging
import socket
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NAME = "fleet"


@contextmanager
def served_bucket() -> Iterator[dict[str, str]]:
    """Serve an empty bucket; hand out the environment in which it is found."""
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    server.start()
    try:
        made = urllib.request.Request(f"http://127.0.0.1:{port}/{NAME}", method="PUT")
        urllib.request.urlopen(made, timeout=30).close()
        yield {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
            "AWS_ACCESS_KEY_ID": "a" * 8,
            "AWS_SECRET_ACCESS_KEY": "b" * 8,
            "AWS_REGION": "us-east-1",
        }
    finally:
        server.stop()


def put_folder(folder: Path, url: str) -> None:
    """Put the files of a folder below a URL, as `aws s3 cp --recursive` does."""
    from obstore import put
    from obstore.store import from_url

    store = from_url(url, client_options={"allow_http": True})
    for file in sorted(folder.iterdir()):
        put(store, file.name, file.read_bytes())
