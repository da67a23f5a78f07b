"""The later versions are installed once."""

from __future__ import annotations

import pytest

from tests.newer.logs import NewerLogs


@pytest.fixture(scope="session")
def newer(tmp_path_factory: pytest.TempPathFactory) -> NewerLogs:
    return NewerLogs(tmp_path_factory.mktemp("newer"))
