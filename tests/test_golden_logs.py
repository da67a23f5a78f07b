"""Logs of every version of the form are read, answer what they answered then, and are continued.

Who changes the form makes the golden log of the new version once (`tools/make_golden.py`); what is
there is never changed, and no answer in it either: an answer may only get more fields.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
from make_golden import in_log, main, said

import semmap_log as sl
from semmap_log.live.oprs.oprs_package import MADE
from semmap_log.store.byte_layout import FORMAT_MINOR, FORMAT_VERSION
from semmap_log.store.reading.segment_scan import open_segment
from tests.store.logs import segment_files

ROOT = Path(__file__).parents[1]
GOLDEN = ROOT / "tests" / "golden"
FORMS = sorted(GOLDEN.glob("format_*"))
WAYS = ("live", "closed", "compacted")
"""As a crash left it; closed; and in large compressed chunks."""

ASK = """
import json, sys
import semmap_log
from make_golden import in_log, said
log, answers = sys.argv[1:]
asked = [one["command"] for one in json.load(open(answers))]
print(json.dumps([semmap_log.__file__, [said(in_log(command, log)) for command in asked]]))
"""


def copied(form: Path, way: str, folder: Path) -> Path:
    return Path(shutil.copytree(form / way / "office", folder / "office"))


def differences(found: Any, expected: Any, where: str = "") -> list[str]:
    """Return where an answer differs from the one of then; what it has more is none."""
    if isinstance(expected, dict) and isinstance(found, dict):
        return [
            line
            for key, value in expected.items()
            for line in differences(found.get(key, "nothing"), value, f"{where}.{key}")
        ]
    if isinstance(expected, list) and isinstance(found, list) and len(expected) == len(found):
        pairs = enumerate(zip(found, expected, strict=True))
        return [line for i, pair in pairs for line in differences(*pair, f"{where}[{i}]")]
    return [] if found == expected else [f"{where}: expected {expected!r}, found {found!r}"]


def test_this_version_of_the_form_has_a_golden_log() -> None:
    """Who adds to the form makes one."""
    name = f"format_{FORMAT_VERSION}_{FORMAT_MINOR}"
    assert name in [form.name for form in FORMS]


def test_a_golden_log_is_never_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is there is refused, and left as it is."""
    there = tmp_path / f"format_{FORMAT_VERSION}_{FORMAT_MINOR}"
    there.mkdir()
    monkeypatch.setattr("sys.argv", ["make_golden.py", "--out", str(tmp_path)])

    assert main() == 1
    assert "never made again" in capsys.readouterr().err
    assert not list(there.iterdir())


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_it_answers_as_it_did(form: Path, way: str, tmp_path: Path) -> None:
    """Doors at many moments, by all that is known and by what was known then."""
    log = copied(form, way, tmp_path)

    for one in json.loads((form / "answers.json").read_text("utf-8")):
        found = said(in_log(one["command"], log))
        assert not differences(found, one["answer"]), one["command"]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_it_is_continued(form: Path, way: str, tmp_path: Path) -> None:
    """Today's program writes on, under a head of its own version."""
    log = copied(form, way, tmp_path)
    segment = segment_files(log)[-1]
    written = form / "live" / "office" / segment.name
    commits = written.read_bytes()[int(open_segment(written).chunks.rows["offset"][0]) :]
    answers = json.loads((form / "answers.json").read_text("utf-8"))

    with sl.append(log, compact=False) as writing:
        more = writing.observe(2, "open", actor="today")

    verified = next(one["answer"] for one in answers if one["command"][0] == "verify")
    history = next(one["answer"] for one in answers if one["command"][0] == "history")
    assert more.first_event == history[-1]["event"] + 1
    assert said(in_log(["verify", "LOG"], log))["commits"] == verified["commits"] + 1
    assert way == "compacted" or commits in segment.read_bytes()
    for one in answers:
        if "--event" in one["command"] or "--known-at" in one["command"]:
            assert not differences(said(in_log(one["command"], log)), one["answer"])


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel as pip builds it from this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(folder), "."]
    subprocess.run(command, cwd=ROOT, check=True, timeout=300)
    (wheel,) = folder.glob("semmap_log-*.whl")
    return wheel


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    """Return a folder with what the wheel installs."""
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(wheel.parent / "site")
    return wheel.parent / "site"


@pytest.mark.slow
def test_all_that_robots_get_is_in_the_wheel(wheel: Path) -> None:
    """The ROS package and the module for OpenPRS, every file; scripts can be run."""
    with zipfile.ZipFile(wheel) as packed:
        modes = {entry.filename: entry.external_attr >> 16 for entry in packed.infolist()}
    live = ROOT / "semmap_log" / "live"
    names = [
        path.relative_to(ROOT).as_posix()
        for folder in (live / "robot_files", live / "oprs" / "semantic_map_oprs")
        for path in folder.rglob("*")
        if path.is_file() and not any(path.match(made) for made in (*MADE, "*.pyc"))
    ]

    assert len(names) > 50
    assert [] == [name for name in names if name not in modes]
    assert all(modes[name] & 0o111 for name in names if "/scripts/" in name)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_the_wheel_answers_as_well(form: Path, installed: Path, tmp_path: Path) -> None:
    """What people install, not the checkout that it was built from."""
    log, answers = copied(form, "closed", tmp_path), form / "answers.json"

    done = subprocess.run(
        [sys.executable, "-c", ASK, str(log), str(answers)], cwd=tmp_path, check=True, timeout=300,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(installed), str(ROOT / "tools")])},
        capture_output=True, text=True,
    )  # fmt: skip

    origin, found = json.loads(done.stdout)
    assert Path(origin).is_relative_to(installed)
    for one, answer in zip(json.loads(answers.read_text("utf-8")), found, strict=True):
        assert not differences(answer, one["answer"]), one["command"]
