"""A bucket for the tests of a room."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.bucket import NAME, served_bucket


@pytest.fixture(scope="session")
def environment() -> Iterator[dict[str, str]]:
    with served_bucket() as named:
        yield named


@pytest.fixture
def bucket(
    environment: dict[str, str], monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> str:
    """
    An empty place in a bucket that the environment names.
    """
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    return f"s3://{NAME}/{request.node.name}"
