"""A bucket for the tests of a room."""

from __future__ import annotations

from tests.bucket import bucket, environment

__all__ = ["bucket", "environment"]
