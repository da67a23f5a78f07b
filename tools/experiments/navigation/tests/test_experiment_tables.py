"""The tables are what the runs were: their own counts, remade from nothing but the logs."""

from __future__ import annotations

import argparse
import csv
import json
import shutil
from collections import Counter
from collections.abc import Mapping
from itertools import accumulate
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory
from typing import Any

import navigation_experiment
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from patrol_sim.tests.corridor import building

from navigation import running
from navigation.options import RunOptions
from navigation.reading_verbs import VERBS, read_runs
from navigation.records import Outcome, RunError, RunKey, RunRecorder
from navigation.tables.experiment import tables_of
from navigation.tables.figures import RunFigures, figures_in
from navigation.tables.grouped import GroupedRuns
from navigation.tables.table import Table
from navigation.tables.thesis import THESIS
from navigation.tests.corridor import DOORS, OPEN, Tally, drive, plan
from navigation.tests.world_of_three_rooms import floor

SEEDS = (1, 2, 3)


@pytest.fixture(scope="module")
def corridor(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[RunKey, Tally]]:
    """Return runs of two setups and both series, with what the drives counted themselves."""
    out = tmp_path_factory.mktemp("runs")
    tallies = {
        RunKey("corridor", setup, series, seed): drive(
            out, setup, seed, series=series, goals=25, near_m=3.0
        )
        for setup in ("no_map", "map")
        for series in ("fixed", "random")
        for seed in SEEDS
    }
    return out, tallies


def found(tables: list[Table], name: str, **about: str) -> Table:
    (table,) = [t for t in tables if t.name == name and about.items() <= t.about.items()]
    return table


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    verb, *others = words
    add_arguments, do = VERBS[verb]
    add_arguments(parser)
    return do(parser.parse_args(others))


def of(tallies: dict[RunKey, Tally], setup: str, series: str) -> list[Tally]:
    return [t for key, t in tallies.items() if (key.setup, key.series) == (setup, series)]


@pytest.mark.parametrize("series", ["fixed", "random"])
@pytest.mark.parametrize(("setup", "title"), [("no_map", "No Map"), ("map", "Map")])
def test_both_tables_of_the_thesis_are_what_the_drives_counted(
    corridor: tuple[Path, dict[RunKey, Tally]], setup: str, title: str, series: str
) -> None:
    """
    Each column of ours from the tallies, each of the thesis's from its pages.
    """
    tables = tables_of(read_runs([corridor[0]]))
    tallies = of(corridor[1], setup, series)
    times, goals = (found(tables, name, series=series) for name in ("runtimes", "goals"))
    (ours, theirs), (our_goals, their_goals) = (
        [row for row in table.rows if row["setup"] == title] for table in (times, goals)
    )

    total_s = [t.end_s - t.begin_s for t in tallies]
    assert ours["total_s"] == pytest.approx(fmean(total_s))
    assert ours["for_goals_s"] == pytest.approx(fmean(sum(t.took_s) for t in tallies))
    assert ours["average_s"] == pytest.approx(fmean(fmean(t.took_s) for t in tallies))
    assert ours["fastest_s"] == pytest.approx(fmean(min(t.took_s) for t in tallies))
    assert ours["slowest_s"] == pytest.approx(fmean(max(t.took_s) for t in tallies))
    slowest = [100 * max(t.took_s) / s for t, s in zip(tallies, total_s, strict=True)]
    assert ours["slowest_percent"] == pytest.approx(fmean(slowest))
    after = [t.outcomes.count(Outcome.AFTER_DRIVING) for t in tallies]
    assert our_goals["tried"] == 25
    assert our_goals["after_driving"] == pytest.approx(fmean(after))
    assert our_goals["percent"] == pytest.approx(100 * sum(after) / 25 / len(SEEDS))
    unreached = [25 - t.outcomes.count(Outcome.REACHED) for t in tallies]
    assert our_goals["unreachable"] == pytest.approx(fmean(unreached))
    thesis = THESIS[series][setup]
    assert (thesis.total_s, thesis.slowest_percent) == (
        theirs["total_s"],
        theirs["slowest_percent"],
    )
    assert (thesis.tried, thesis.percent) == (their_goals["tried"], their_goals["percent"])


@pytest.mark.parametrize("setup", ["no_map_star", "map_star", "patrol"])
def test_a_real_run_comes_to_what_it_counted(
    setup: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """
    The experiment's own robot in a world of three rooms, told of by its own calls.
    """
    pytest.importorskip("pyastar2d", reason="not installed: pip install 'semmap-log[experiment]'")
    told: list[tuple[Outcome, float, float]] = []

    class Counting(RunRecorder):
        sent_s = 0.0

        def goal_sent(self, t: float, number: int, x: float, y: float, *, kind: str = "") -> None:
            self.sent_s = t
            super().goal_sent(t, number, x, y, kind=kind)

        def goal_ended(
            self, t: float, number: int, outcome: Outcome | str, figures: Mapping[str, Any]
        ) -> None:
            told.append((Outcome(outcome), t - self.sent_s, figures["path_m"]))
            super().goal_ended(t, number, outcome, figures)

    monkeypatch.setattr(running, "RunRecorder", Counting)
    options = RunOptions(goals=12, every_s=120.0)
    task = running.RunTask(building(tmp_path), 1, setup, "fixed", 5, options)
    figures = figures_in(running.run(task, floor(), tmp_path / "runs"))

    outcomes = Counter(outcome for outcome, *_ in told)
    took_s = [took for outcome, took, _ in told if outcome is Outcome.REACHED]
    assert figures.reached == outcomes[Outcome.REACHED] == 12
    assert figures.tried == len(told)
    assert figures.after_driving == outcomes[Outcome.AFTER_DRIVING]
    assert figures.took_s == pytest.approx(took_s, abs=1e-6)
    assert figures.path_m == pytest.approx(sum(path_m for *_, path_m in told))
    assert figures.building == task.key.building.partition(",")[0]


def test_the_same_tables_are_made_of_the_logs_alone(
    corridor: tuple[Path, dict[RunKey, Tally]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """
    Byte for byte, elsewhere, where there is nothing but the logs' own segments.
    """
    out, _ = corridor
    for segment in out.rglob("*.mcap"):
        target = tmp_path / "elsewhere" / segment.relative_to(out)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(segment, target)

    told = []
    for folder in (out, tmp_path / "elsewhere"):
        csvs = tmp_path / f"csv_{len(told)}"
        for form in ([], ["--json"]):
            assert run("tables", str(folder), "--csv", str(csvs), "--jobs", "1", *form) == 0
            told.append((capsys.readouterr().out, {p.name: p.read_bytes() for p in csvs.iterdir()}))

    assert told[:2] == told[2:]
    assert len(told[0][1]) == 5
    assert "thesis, 2 runs" in told[0][0]


def test_many_processes_read_the_same(corridor: tuple[Path, dict[RunKey, Tally]]) -> None:
    """
    In the same order.
    """
    assert read_runs([corridor[0]], jobs=1).all == read_runs([corridor[0]], jobs=2).all


def test_documents_hold_every_row(
    corridor: tuple[Path, dict[RunKey, Tally]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """
    JSON without NaN; CSV with a row a run.
    """
    run("tables", str(corridor[0]), "--json", "--csv", str(tmp_path), "--jobs", "1")

    def refuse(constant: str) -> Any:
        raise AssertionError(constant)

    told = json.loads(capsys.readouterr().out, parse_constant=refuse)["tables"]
    rows = list(csv.DictReader((tmp_path / "runs.csv").open(encoding="utf-8")))
    assert len(corridor[1]) == len(rows)
    (runs,) = [table for table in told if table["table"] == "runs"]
    assert [row["seed"] for row in runs["rows"]] == [int(row["seed"]) for row in rows]
    for row in rows:
        tally = corridor[1][RunKey(row["building"], row["setup"], row["series"], int(row["seed"]))]
        assert tally.outcomes.count(Outcome.AFTER_DRIVING) == int(row["after_driving"])
        assert sum(tally.took_s) == pytest.approx(float(row["for_goals_s"]))


def test_differences_are_of_pairs(corridor: tuple[Path, dict[RunKey, Tally]]) -> None:
    """
    Of the same seed; a seed that only one setup has does not count.
    """
    runs = read_runs([corridor[0]])
    alone = [run for run in runs.all if (run.key.setup, run.key.seed) != ("map", 3)]
    table = found(tables_of(GroupedRuns(alone)), "differences")

    (row,) = table.rows
    first, second = of(corridor[1], "no_map", "fixed"), of(corridor[1], "map", "fixed")
    one, other = (
        [100 * tally.outcomes.count(Outcome.AFTER_DRIVING) / 25 for tally in tallies[:2]]
        for tallies in (first, second)
    )
    points = fmean(one) - fmean(other)
    assert row["pairs"] == 2
    assert row["points"] == pytest.approx(points)
    assert row["what"] == "No Map - Map"


def test_a_sweep_is_over_the_same_seeds(
    corridor: tuple[Path, dict[RunKey, Tally]], tmp_path: Path
) -> None:
    """
    The usual value is the one of most runs: beside each other one it stands with the seeds of that,
    and only its runs are in the other tables.
    """
    tally = drive(tmp_path, "map", seed=2, goals=12, near_m=1.0)
    drive(tmp_path, "map", seed=9, goals=12, near_m=1.0)
    tables = tables_of(read_runs([corridor[0], tmp_path]))

    sweep = found(tables, "sweep", series="fixed")
    assert [("1.0", ""), ("3.0", "1.0")] == [(row["value"], row["beside"]) for row in sweep.rows]
    same = corridor[1][RunKey("corridor", "map", "fixed", 2)]
    for row, counted, goals in zip(sweep.rows, (tally, same), (12, 25), strict=True):
        share = 100 * counted.outcomes.count(Outcome.AFTER_DRIVING) / goals
        assert row["map"] == pytest.approx(share)
        assert row["runs"] == "1"
        assert "no_map" not in row
    assert found(tables, "goals", series="fixed") == found(
        tables_of(read_runs([corridor[0]])), "goals", series="fixed"
    )
    assert "No Map" not in sweep.text()


def test_what_was_swept_in_one_building_is_fixed_in_another(tmp_path: Path) -> None:
    """
    Of as many runs at each value the one is usual that `run` takes; each building has its own.
    """
    for near_m in (1.0, 3.0):
        drive(tmp_path, seed=1, goals=8, near_m=near_m, building=f"corridor,near_m={near_m:g}")
    drive(tmp_path, seed=1, goals=8, near_m=1.0, building="other")

    runs = read_runs([tmp_path])

    assert runs.swept == {"corridor": {"near_m": ["3.0", "1.0"]}, "other": {}}
    assert [run.options for run in runs.of("other", "fixed", "map")] == [{"near_m": 1.0}]
    assert [run.options for run in runs.of("corridor", "fixed", "map")] == [{"near_m": 3.0}]
    assert ["goals", "runtimes", "sweep"] == sorted(
        {table.name for table in tables_of(runs)} - {"costs", "differences"}
    )


def test_a_run_that_is_older_than_an_option_had_the_usual_one(tmp_path: Path) -> None:
    """
    It stands beside those that tell of it.
    """
    drive(tmp_path, seed=1, goals=8)
    drive(tmp_path, seed=2, goals=8, near_m=RunOptions().near_m)

    runs = read_runs([tmp_path])

    assert runs.swept == {"corridor": {}}
    assert 2 == len(runs.of("corridor", "fixed", "map"))


def test_a_series_that_was_only_swept_has_no_other_tables(tmp_path: Path) -> None:
    """
    And does not stand in the way of those that have.
    """
    for seed in (1, 2):
        drive(tmp_path, seed=seed, goals=8, series="random", near_m=3.0)
    drive(tmp_path, seed=1, goals=8, near_m=1.0)
    runs = read_runs([tmp_path])

    assert ["random", "fixed"] == runs.series("corridor")
    assert {"random"} == {t.about["series"] for t in tables_of(runs) if t.name != "sweep"}


def test_runs_are_given_once(corridor: tuple[Path, dict[RunKey, Tally]]) -> None:
    """
    Twice the same run would narrow every interval.
    """
    with pytest.raises(RunError, match="twice"):
        read_runs([corridor[0], corridor[0]])


def test_the_thesis_adds_up() -> None:
    """
    Its percentages are those of its counts and seconds, as far as it rounds.
    """
    for rows in THESIS.values():
        for row in rows.values():
            assert row.percent == pytest.approx(100 * row.after_driving / row.tried, abs=0.006)
            assert row.slowest_percent == pytest.approx(
                100 * row.slowest_s / row.total_s, abs=0.006
            )
            assert row.average_percent == pytest.approx(
                100 * row.average_s / row.total_s, abs=0.006
            )


@given(
    ends=st.lists(st.tuples(st.sampled_from(Outcome), st.integers(1, 500)), min_size=1, max_size=8)
)
@settings(max_examples=20)
def test_figures_of_any_run(ends: list[tuple[Outcome, int]]) -> None:
    """
    Whatever the outcomes: counts and times by hand; one that was not finished is no goal.
    """
    key = RunKey("corridor", "map", "fixed", 1)
    counted = [(outcome, took) for outcome, took in ends if outcome is not Outcome.UNFINISHED]
    with TemporaryDirectory() as folder:
        with RunRecorder(
            Path(folder), key, plan(), {}, states=dict.fromkeys(DOORS, OPEN)
        ) as recorder:
            stops = [0, *accumulate(took for _, took in ends)]
            for number, (outcome, _) in enumerate(ends, start=1):
                recorder.goal_sent(stops[number - 1], number, 0.0, 0.0)
                path_m = 2.0 * (number % 2)
                recorder.goal_ended(stops[number], number, outcome, {"path_m": path_m})
        if not counted:
            with pytest.raises(RunError, match="no goal ended"):
                figures_in(key.folder(Path(folder)))
            return
        run = figures_in(key.folder(Path(folder)))

    took = [took for outcome, took in counted if outcome is Outcome.REACHED]
    after = [took for outcome, took in counted if outcome is Outcome.AFTER_DRIVING]
    assert (run.tried, run.after_driving) == (len(counted), len(after))
    assert (run.reached, run.unreachable) == (len(took), len(counted) - len(took))
    assert (run.for_goals_s, run.in_vain_s) == (sum(took), sum(after))
    assert run.took_s == tuple(took)
    moved = [n % 2 for n, (end, _) in enumerate(ends, 1) if end is not Outcome.UNFINISHED]
    assert run.path_m == 2.0 * sum(moved)
    spot = [n for n, (end, _) in enumerate(ends, 1) if end is Outcome.AFTER_DRIVING and n % 2 == 0]
    assert run.on_the_spot == len(spot)
    if took:
        assert (run.average_s, run.slowest_s) == (pytest.approx(fmean(took)), max(took))
        assert run.fastest_s == min(took)


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["tables", "nowhere"], "nowhere: expected runs in BUILDING/SETUP/SERIES-SEED, found none"),
        (["rerun", "nowhere"], "nowhere: expected a run, which has the logs world and belief"),
        (["page", "{out}", "--to", "/dev/null/x.html", "--jobs", "1"], "could not be written"),
    ],
    ids=["no runs", "no run", "no place"],
)
def test_what_cannot_be_done_is_one_line(
    corridor: tuple[Path, dict[RunKey, Tally]],
    words: list[str],
    problem: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """
    And exit code 1.
    """
    code = navigation_experiment.main([word.format(out=corridor[0]) for word in words])

    told = capsys.readouterr()
    assert (code, told.out) == (1, "")
    assert problem in told.err
    assert told.err.count("\n") == 1


def test_one_run_has_no_interval(tmp_path: Path) -> None:
    """
    It is drawn without one, and nothing is called clear.
    """
    for setup in ("no_map", "map", "no_map_star"):
        drive(tmp_path, setup, goals=25)
    runs = read_runs([tmp_path])

    text = "\n".join(table.text() for table in tables_of(runs))

    assert "±" not in text.replace("±:", "")
    assert "nan" not in text
    assert not {"yes", "no"} & set(text.split())
    assert isinstance(runs.all[0], RunFigures)
