"""Golden files of wordings: compared by case, rewritten on demand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.golden_text import GoldenText


def test_a_text_is_compared_with_its_case_alone(tmp_path: Path) -> None:
    compares = GoldenText(tmp_path, folder=tmp_path / "wording")
    rewrites = replace(compares, is_rewritten=True)
    rewrites("show", "wide", f"two\n\nlines of {tmp_path}/log\n")
    rewrites("show", "empty", "")
    rewrites("show", "wide", f"two\n\nlines in {tmp_path}/log\n")

    compares("show", "wide", f"two\n\nlines in {tmp_path}/log\n")
    compares("show", "empty", "")
    for verb, case, text in (
        ("show", "wide", "two\n\nlines of TMP/log\n"),
        ("show", "narrow", "two\n\nlines in TMP/log\n"),
        ("tail", "wide", "two\n\nlines in TMP/log\n"),
    ):
        with pytest.raises(AssertionError, match="--golden"):
            compares(verb, case, text)
