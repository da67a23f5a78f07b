"""A bucket of an S3 server that runs for the tests: moto's, which honours conditional writes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from benchmark.bucket import NAME, served_bucket

__all__ = ["NAME", "bucket", "environment", "put_folder", "served_bucket"]


@pytest.fixture(scope="session")
def environment() -> Iterator[dict[str, str]]:
    with served_bucket() as named:
        yield named


@pytest.fixture
def bucket(
    environment: dict[str, str], monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> str:
    """An empty place in a bucket that the environment names."""
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    return f"s3://{NAME}/{request.node.name}"


def put_folder(folder: Path, url: str) -> None:
    """Put the files of a folder below a URL, as `aws s3 cp --recursive` does."""
    from obstore import put
    from obstore.store import from_url

    store = from_url(url, client_options={"allow_http": True})
    for file in sorted(folder.iterdir()):
        put(store, file.name, file.read_bytes())
