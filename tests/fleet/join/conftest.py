"""Logs of later versions for the tests of a room."""

from __future__ import annotations

from tests.newer.conftest import newer as newer  # noqa: PLC0414 - a fixture
