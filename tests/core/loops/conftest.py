"""Loops on and off, whatever the environment says."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from semmap_log.core import loops


@pytest.fixture
def turn(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bool], None]]:
    """Turn the loops on or off; where they were not built, what wants them is skipped."""

    def turn_them(on: bool) -> None:
        monkeypatch.setenv(loops.WITHOUT, "0" if on else "1")
        loops.compiled.cache_clear()
        if on and loops.compiled() is None:
            pytest.skip("the loops were not built: there is no C compiler, or no Cython")

    yield turn_them
    monkeypatch.undo()
    loops.compiled.cache_clear()
