"""The fixtures of the main tests that experiments use."""

from __future__ import annotations

from tests.conftest import shared_data  # noqa: F401 - a fixture
