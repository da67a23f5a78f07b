"""Where the tables of a log can lie."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import LogAccessError
from semmap_log.replay.read_model.indexing import index


def test_a_path_that_is_no_text_is_an_error(tmp_path: Path) -> None:
    """
    It says so in one line that can be printed; the log is as it was.
    """
    log = Path(os.fsdecode(bytes(tmp_path) + b"/a\xff"))
    sl.create(log, tz="UTC").close()
    before = sorted(path.name for path in log.iterdir())

    with pytest.raises(LogAccessError, match="expected a path in UTF-8") as error:
        index(log)

    assert str(error.value).encode()
    assert sorted(path.name for path in log.iterdir()) == before
