"""The options of the main tests, and the fixtures that experiments use."""

from __future__ import annotations

from tests.conftest import pytest_addoption, shared_data  # noqa: F401 - a hook, a fixture
