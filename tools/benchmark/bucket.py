"""A bucket of an S3 server on this machine: moto's, which honours conditional writes."""

from __future__ import annotations

import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager

NAME = "fleet"


@contextmanager
def served_bucket() -> Iterator[dict[str, str]]:
    """Serve an empty bucket, `NAME`; hand out the environment in which it is found.

    Raises:
        ModuleNotFoundError: moto is not installed.
    """
    import boto3
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    server.start()
    try:
        named = {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
            "AWS_ACCESS_KEY_ID": "a" * 8,
            "AWS_SECRET_ACCESS_KEY": "b" * 8,
            "AWS_REGION": "us-east-1",
        }
        boto3.client(
            "s3",
            endpoint_url=named["AWS_ENDPOINT_URL"],
            aws_access_key_id=named["AWS_ACCESS_KEY_ID"],
            aws_secret_access_key=named["AWS_SECRET_ACCESS_KEY"],
            region_name=named["AWS_REGION"],
        ).create_bucket(Bucket=NAME)
        yield named
    finally:
        server.stop()
