"""A bucket of an S3 server that runs for the tests: moto's, which honours conditional writes."""

from __future__ import annotations

from pathlib import Path

from benchmark.bucket import NAME, served_bucket

__all__ = ["NAME", "put_folder", "served_bucket"]


def put_folder(folder: Path, url: str) -> None:
    """Put the files of a folder below a URL, as `aws s3 cp --recursive` does."""
    from obstore import put
    from obstore.store import from_url

    store = from_url(url, client_options={"allow_http": True})
    for file in sorted(folder.iterdir()):
        put(store, file.name, file.read_bytes())
