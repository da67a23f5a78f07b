"""A fleet's answers: those of each log alone, whatever becomes of workers and other logs."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import dask
import distributed  # noqa: F401  it brings settings of its own, which a block of them must outlast
import pyarrow as pa
import pytest

import semmap_log as sl
from semmap_log.errors import EngineError, MomentError
from semmap_log.fleet.jobs import dask_engine, door_jobs
from semmap_log.fleet.jobs import job as job_module
from semmap_log.fleet.jobs.job import FleetAnswer
from tests.bucket import put_folder
from tests.fleet.jobs.fleets import START_NS, doors_then, events_of, make_log, openings_then
from tests.fleet.jobs.projections import KillsItsWorker, KillsOnce, Raises, Sightings, Slowly, Whole
from tests.store.logs import segment_files
from tests.verbs import Verb


def outcomes(found: FleetAnswer) -> dict[str, str]:
    return {Path(log.place).name: log.outcome.value for log in found.logs}


def rows_of(found: FleetAnswer, log: Path) -> list[dict[str, Any]]:
    table = found.table.cast(
        pa.schema(
            field.with_type(pa.int64()) if pa.types.is_timestamp(field.type) else field
            for field in found.table.schema
        )
    )
    return [row for row in table.to_pylist() if row["log"] == str(log)]


@pytest.mark.parametrize("engine", ["serial", "dask"])
def test_maps_and_openings_are_those_of_the_events(made_fleet: Path, engine: str) -> None:
    """Worked out from exported lines by a loop that knows nothing of timelines."""
    fleet = sl.fleet(made_fleet, engine=engine, workers=2)

    maps, openings = fleet.map(), fleet.openings()

    assert {"ok"} == set(outcomes(maps).values())
    for log in map(Path, fleet.places):
        events = events_of(log)
        assert doors_then(events) == {r["door_id"]: r["state"] for r in rows_of(maps, log)}
        told = {(r["door_id"], _hour(r["hour"])): r["openings"] for r in rows_of(openings, log)}
        assert openings_then(events) == told
        assert told


def _hour(time_ns: int) -> str:
    return time.strftime("%Y-%m-%dT%H", time.gmtime(time_ns // 10**9))


def test_a_moment_is_that_of_each_log_alone(made_fleet: Path, run_verb: Verb) -> None:
    """
    `--at` and `--known-at`, probabilities, info and verify as the verbs for one log have them.
    """
    at = START_NS + 3 * 3600 * 10**9
    fleet = sl.fleet(made_fleet, engine="serial")

    maps = fleet.map(at=at)
    beliefs = fleet.probabilities(at=at)
    info, verified = fleet.info(), fleet.verify()

    for log in map(Path, fleet.places[:3]):
        then = sl.read(log).replay(at=at)
        assert [d.state.name for d in then.doors.values()] == [
            row["state"] for row in rows_of(maps, log)
        ]
        said = run_verb("probabilities", log, "--at", f"@{at}", "--json").json
        assert [(d["door_id"], d["p_open"]) for d in said["doors"]] == [
            (row["door_id"], round(row["p_open"], 6)) for row in rows_of(beliefs, log)
        ]
        told, whole = (run_verb(verb, log, "--json").json for verb in ("info", "verify"))
        (row,) = rows_of(info, log)
        assert (told["events"], told["head"], told["bytes"]) == (
            row["events"], row["head"], row["bytes"]
        )  # fmt: skip
        (row,) = rows_of(verified, log)
        assert (0, whole["head"], whole["bytes"]) == (row["exit_code"], row["head"], row["bytes"])


def test_parts_of_a_long_log_make_the_answer_of_the_whole(
    made_fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Doors apart, or ranges of events apart, merged in their order."""
    fleet = sl.fleet(made_fleet, engine="serial", fresh=True)
    openings, folded = fleet.openings(), fleet.fold(Sightings())
    monkeypatch.setattr(door_jobs, "PART_EVENTS", 20)
    monkeypatch.setattr(job_module, "PART_EVENTS", 7)

    in_parts, merged, whole = fleet.openings(), fleet.fold(Sightings()), fleet.fold(Whole())

    assert openings.table == in_parts.table
    assert openings.table.num_rows
    assert folded.states == merged.states == whole.states
    assert openings.logs == in_parts.logs
    one = fleet.places[0]
    seen = Counter(e["door_id"] for e in events_of(Path(one)) if e["kind"] == "DoorObserved")
    assert seen == folded.states[one]


def test_parts_are_of_the_moment_at_which_the_log_was_looked_at(
    made_fleet: Path, tmp_path: Path
) -> None:
    """It goes on while its parts are asked, and takes back what counted then."""
    log = tmp_path / "log"
    shutil.copytree(made_fleet / "tug0", log)
    last = sl.read(log).last_event()
    jobs = (door_jobs.OpeningsJob(), job_module.FoldJob(Sightings()))
    expected = [job.ask(sl.read(log)) for job in jobs]
    with sl.append(log) as writer:
        for number in range(12, 20):
            writer.retract(number)
        for state in ("open", "closed", "open"):
            writer.observe("d0", state)

    grown = sl.read(log)
    for job, told in zip(jobs, expected, strict=True):
        assert told.rows != job.ask(grown).rows
        assert told.rows == job.joined([job.ask_part(grown, n, 3, last) for n in range(3)]).rows


def test_one_of_each_kind_of_bad_log_among_forty(made_fleet: Path, tmp_path: Path) -> None:
    """Damaged, with file and byte; with a gap; live; one that goes; all others right."""
    logs = tmp_path / "logs"
    logs.mkdir()
    for number in range(40):
        shutil.copytree(made_fleet / f"tug{number % 8}", logs / f"bot{number:02}")
    (damaged,) = segment_files(logs / "bot03")
    data = bytearray(damaged.read_bytes())
    data[data.rindex(b"semmap_index") - 300] ^= 1  # in its last chunk
    damaged.write_bytes(data)
    shutil.rmtree(logs / "bot07")
    _log_with_a_gap(logs / "bot07")
    shutil.rmtree(logs / "bot11")
    live = make_log(logs / "bot11", 11, close=False)
    fleet = sl.fleet(logs, workers=2)
    shutil.rmtree(logs / "bot20")

    try:
        found = fleet.openings()
    finally:
        live.close()

    told = outcomes(found)
    odd = {"bot03": "damaged", "bot07": "damaged", "bot11": "live", "bot20": "gone"}
    assert {f"bot{n:02}": "ok" for n in range(40)} | odd == told
    (bad,) = (log for log in found.logs if log.place.endswith("bot03"))
    assert damaged.name == bad.file
    assert bad.byte is not None
    alone = sl.fleet(made_fleet, engine="serial").openings()
    by_log = {Path(p).name: rows_of(alone, made_fleet / Path(p).name) for p in alone_places(alone)}
    for number in range(40):
        name = f"bot{number:02}"
        if name not in odd:
            rows = rows_of(found, logs / name)
            assert [_but_log(r) for r in by_log[f"tug{number % 8}"]] == [_but_log(r) for r in rows]


def alone_places(found: FleetAnswer) -> list[str]:
    return [log.place for log in found.logs]


def _but_log(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name != "log"}


def _log_with_a_gap(folder: Path) -> None:
    make_log(folder, 7, hours=60)
    files = segment_files(folder)
    assert len(files) > 2
    files[1].unlink()


def test_a_worker_that_is_killed_takes_nothing_along(made_fleet: Path, tmp_path: Path) -> None:
    """Its log is given to another; one that kills each worker is named, and only that one."""
    doors = [len({e["door_id"] for e in events_of(made_fleet / f"tug{n}")
                  if e["kind"] == "DoorObserved"}) for n in range(8)]  # fmt: skip
    fleet = sl.fleet(made_fleet, workers=2)
    expected = sl.fleet(made_fleet, engine="serial").fold(Sightings()).states

    killed_once = fleet.fold(KillsOnce(str(tmp_path / "mark")))

    assert (tmp_path / "mark").exists()
    assert (expected, ()) == (killed_once.states, killed_once.bad)
    assert doors == [3] * 8
    make_log(tmp_path / "tug8", 8)
    with sl.append(tmp_path / "tug8") as log:
        log.observe(log.add_door(x=9.0, y=0.0, theta=0.0, width=1.0), "open")
    poisoned = sl.fleet([made_fleet, tmp_path / "tug8"], workers=2).fold(KillsItsWorker(4))
    assert ["tug8"] == [Path(log.place).name for log in poisoned.bad]
    assert "worker died" == poisoned.bad[0].outcome.value
    assert expected == poisoned.states


def test_a_worker_that_comes_back_late_is_waited_for(made_fleet: Path, tmp_path: Path) -> None:
    """
    On a busy machine its start takes longer than Dask waits before it gives a worker up for good.
    """
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "50ms"}):
        found = sl.fleet(made_fleet, workers=1, timeout_s=120).fold(KillsOnce(f"{tmp_path}/mark"))

    assert (tmp_path / "mark").exists()
    assert () == found.bad


@pytest.mark.slow
def test_logs_whose_worker_does_not_come_back_have_no_answer(
    made_fleet: Path, tmp_path: Path
) -> None:
    """Each is named, none is waited for without end, and what was answered is kept."""
    expected = sl.fleet(made_fleet, engine="serial").fold(Sightings()).states
    port, once = _free_port(), KillsOnce(f"{tmp_path}/mark")
    options: dict[str, Any] = {"scheduler": f"tcp://127.0.0.1:{port}", "results": tmp_path / "r"}
    with _dask(port):  # its one worker is nobody's to start again
        found = sl.fleet(made_fleet, timeout_s=5, **options).fold(once)

    assert "no answer" in set(outcomes(found).values()) <= {"ok", "no answer"}
    assert {log.place for log in found.logs} - {log.place for log in found.bad} == set(found.states)
    assert "no worker has answered for 5 s" in found.bad[0].text
    with _dask(port):
        again = sl.fleet(made_fleet, timeout_s=120, **options).fold(once)
    assert (expected, ()) == (again.states, again.bad)
    assert len(found.states) == sum(log.is_kept for log in again.logs)


def test_what_was_answered_is_not_asked_again(made_fleet: Path, tmp_path: Path) -> None:
    """Until a log has grown, the question is another, its answer's file is cut."""
    logs = tmp_path / "logs"
    shutil.copytree(made_fleet, logs)
    places = [str(logs / f"tug{n}") for n in range(8)]

    def asked(**options: Any) -> tuple[int, FleetAnswer]:
        found = sl.fleet(places, engine="serial", results=tmp_path / "r", **options).openings()
        return sum(not log.is_kept for log in found.logs), found

    first = asked()
    again = asked()
    assert (8, 0) == (first[0], again[0])
    assert first[1].table == again[1].table
    assert 8 == asked(fresh=True)[0]
    with sl.append(logs / "tug2") as log:
        log.observe("d0", "open")
        log.observe("d0", "closed")
        log.observe("d0", "open")
    assert 1 == asked()[0]
    files = sorted((tmp_path / "r").rglob("*.answer"))
    assert 8 == len(files)
    whole = files[0].read_bytes()
    a_count = bytes([whole[-24] ^ 1])  # in the last column, which Arrow puts no sum over
    for spoilt in (whole[: len(whole) // 2], b"", whole[:-24] + a_count + whole[-23:]):
        files[0].write_bytes(spoilt)
        number, found = asked()
        assert 1 == number
        assert found.table == asked()[1].table
    other = sl.fleet(places, engine="serial", results=tmp_path / "r").map(at=START_NS + 1)
    assert not any(log.is_kept for log in other.logs)
    at_last = sl.fleet(places, engine="serial", results=tmp_path / "r2").openings()
    assert at_last.table == asked()[1].table


def test_verify_believes_no_earlier_answer(made_fleet: Path, tmp_path: Path) -> None:
    """Bytes rot under the same head."""
    logs = tmp_path / "logs"
    shutil.copytree(made_fleet, logs)
    fleet = sl.fleet(logs, engine="serial")
    assert not fleet.verify().bad
    (segment,) = segment_files(logs / "tug5")
    data = bytearray(segment.read_bytes())
    data[len(data) // 2] ^= 1
    segment.write_bytes(data)

    (bad,) = fleet.verify().bad

    assert ("tug5", "damaged", segment.name) == (
        Path(bad.place).name, bad.outcome.value, bad.file
    )  # fmt: skip


def test_a_moment_that_one_zone_does_not_have_is_a_row(made_fleet: Path, tmp_path: Path) -> None:
    """02:30 on the day when the clocks of Vienna leave it out."""
    with sl.create(tmp_path / "vienna", tz="Europe/Vienna") as log:
        log.add_door(x=0.0, y=0.0, theta=0.0, width=1.0)

    found = sl.fleet([made_fleet, tmp_path / "vienna"], engine="serial").map("2026-03-29T02:30")

    assert ["vienna"] == [Path(log.place).name for log in found.bad]
    assert "2026-03-29" in found.bad[0].text


def test_two_runs_at_once_answer_the_same(made_fleet: Path, tmp_path: Path) -> None:
    found: list[FleetAnswer] = []

    def ask() -> None:
        fleet = sl.fleet(made_fleet, engine="serial", results=tmp_path / "r")
        found.extend(fleet.openings() for _ in range(3))

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert 9 == len(found)
    assert all(found[0].table == each.table for each in found)
    assert not [path for path in (tmp_path / "r").rglob("*") if path.name.endswith(".new")]


def test_wrong_questions_are_errors_and_a_users_own_are_rows(
    made_fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fleet = sl.fleet(made_fleet, engine="serial")

    with pytest.raises(MomentError, match="noonish"):
        fleet.map(at="noonish")
    found = fleet.fold(Raises())

    assert {"failed"} == set(outcomes(found).values())
    assert "ZeroDivisionError: a user's own" == found.bad[0].text
    with pytest.raises(EngineError, match="expected one of dask, serial"):
        sl.fleet(made_fleet, engine="spark").map()
    monkeypatch.setattr(dask_engine, "ANSWERS_WITHIN_S", 1)
    with pytest.raises(EngineError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:9"):
        sl.fleet(made_fleet, scheduler="tcp://127.0.0.1:9").map()


@contextmanager
def _dask(port: int) -> Iterator[subprocess.Popen[bytes]]:
    """A cluster as an operator starts one: a scheduler, and a worker."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    address = f"tcp://127.0.0.1:{port}"
    python = [sys.executable, "-m"]
    scheduler = subprocess.Popen(
        [*python, "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard"],
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    worker = subprocess.Popen(
        [*python, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny",
         "--no-dashboard", "--death-timeout", "60"],
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield scheduler
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait()


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
        return port


def test_a_scheduler_that_dies_is_told_and_the_next_run_goes_on(
    made_fleet: Path, tmp_path: Path
) -> None:
    """On a cluster that others have started; what had answered is not asked again."""
    fleet = sl.fleet(made_fleet, engine="serial")
    expected = fleet.fold(Slowly()).table
    port = _free_port()

    def ask(progress: Any = None) -> FleetAnswer:
        address = f"tcp://127.0.0.1:{port}"
        found: FleetAnswer = sl.fleet(made_fleet, scheduler=address, results=tmp_path / "r").fold(
            Slowly(), progress=progress
        )
        return found

    with _dask(port) as scheduler:

        def kill(now: Any) -> None:
            if now.done == 3:
                scheduler.send_signal(signal.SIGKILL)

        with pytest.raises(EngineError, match="the Dask scheduler has gone"):
            ask(kill)
    kept = len(list((tmp_path / "r").rglob("*.answer")))
    assert 3 <= kept < 8

    with _dask(port):
        found = ask()

    assert expected == found.table
    assert kept == sum(log.is_kept for log in found.logs)


def test_logs_in_a_bucket(made_fleet: Path, bucket: str) -> None:
    """A prefix, a pattern, a list; the answers of the disk."""
    for number in range(8):
        put_folder(made_fleet / f"tug{number}", f"{bucket}/clinic/tug{number}")
    local = sl.fleet(made_fleet, engine="serial").openings().table

    with sl.fleet(f"{bucket}/clinic", workers=2) as fleet:  # one engine for both questions
        assert 24 == fleet.map(at=START_NS + 10**9).table.num_rows
        found = fleet.openings()

    assert [f"{bucket}/clinic/tug{n}" for n in range(8)] == list(fleet.places)
    assert not found.bad
    assert local.drop_columns("log") == found.table.drop_columns("log")
    assert fleet.places[2:4] == sl.fleet(f"{bucket}/cl*/tug[23]").places
