"""`eval_thinning.py` in small: what goes is counted, and beliefs hardly move."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest
from eval_thinning import main

HOURS = 24 * 8


@pytest.fixture
def doors(tmp_path: Path) -> Path:
    """Two doors that open at eight and are shut at five, known for eight days."""
    rows = [
        f"2026-03-{1 + day:02}T{hour:02}:00:00,{door},{state}"
        for door in ("a", "b")
        for day in range(8)
        for hour, state in ((0, "closed"), (8, "open"), (17, "closed"))
    ]
    with gzip.open(tmp_path / "doors.csv.gz", "wt") as file:
        file.write("\n".join(["timestamp,door,state", *rows]))
    known = [f"{door},2026-03-01T00:00:00,2026-03-09T00:00:00" for door in ("a", "b")]
    (tmp_path / "obs_windows.csv").write_text("\n".join(["door,start,end", *known]))
    return tmp_path


def test_regular_looks_lose_nothing_and_irregular_ones_little(
    doors: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """
    What was taken out counts where it was: exactly, where looks are as far apart as told.
    """
    assert main([str(doors), "--seeds", "2", "--json"]) == 0

    regular, irregular = json.loads(capsys.readouterr().out)
    assert [regular["looks"], irregular["looks"]] == ["regular", "irregular"]
    assert regular["doors"] == 2
    assert regular["sightings"] == pytest.approx(2 * HOURS * 12, abs=4)
    for one, most in ((regular, 1e-3), (irregular, 0.05)):
        assert 0.2 < one["gone"] < 0.75
        assert one["bytes_left"] > 0.5
        for name in ("filter", "schedule", "count"):
            assert one[name]["mean"] <= one[name]["most"] < most
    assert irregular["count"]["most"] > 0


def test_people_get_a_table(doors: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """
    A row for each kind of looks.
    """
    assert main([str(doors), "--seeds", "1", "--doors", "1"]) == 0

    head, regular, irregular = capsys.readouterr().out.splitlines()
    assert "|dP| schedule" in head
    assert " regular " in regular
    assert " irregular " in irregular
