"""Which logs are meant by paths, folders, patterns and lists."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from semmap_log.errors import FormatError, NotALogError
from semmap_log.fleet.jobs.log_places import log_places


def names(*named: object) -> list[str]:
    return [Path(place).name for place in log_places([str(each) for each in named])]


def test_a_log_a_folder_of_logs_and_a_pattern(made_fleet: Path) -> None:
    assert ["tug3"] == names(made_fleet / "tug3")
    assert [f"tug{n}" for n in range(8)] == names(made_fleet)
    assert ["tug2", "tug5"] == names(made_fleet / "tug[25]")
    assert [f"tug{n}" for n in range(8)] == names(made_fleet.parent / "l*" / "tug*")
    assert ["tug5", "tug0", "tug1"] == names(
        made_fleet / "tug5", made_fleet / "tug[01]", made_fleet / "tug0"
    )


def test_a_list_has_one_a_line(made_fleet: Path, tmp_path: Path) -> None:
    listed = tmp_path / "logs.txt"
    listed.write_text(f"# the clinic's\n{made_fleet / 'tug1'}\n\n  {made_fleet / 'tug[67]'}\n")

    assert ["tug1", "tug6", "tug7"] == names(f"@{listed}")
    with pytest.raises(FormatError, match="expected a list of logs"):
        names(f"@{tmp_path / 'none.txt'}")


def test_a_folder_whose_name_is_a_pattern_is_itself(made_fleet: Path, tmp_path: Path) -> None:
    odd = tmp_path / "tug[1]"
    shutil.copytree(made_fleet / "tug4", odd)

    assert ["tug[1]"] == names(odd)


def test_nothing_meant_is_an_error_and_a_missing_log_is_the_runs_business(
    made_fleet: Path, tmp_path: Path
) -> None:
    with pytest.raises(NotALogError, match=r"robo\*: expected logs, found none"):
        names(made_fleet / "robo*")
    with pytest.raises(NotALogError, match="at least one log"):
        log_places([])
    assert ["away"] == names(tmp_path / "away")
