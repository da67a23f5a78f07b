"""The options of all tests, those of experiments included."""

from __future__ import annotations

from tests.quick import (  # noqa: F401 - pytest's hooks
    pytest_addoption,
    pytest_collection_modifyitems,
    pytest_configure,
    pytest_sessionfinish,
    pytest_terminal_summary,
    pytest_testnodedown,
)
