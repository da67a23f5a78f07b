"""`tools/mutate.py`: which mutants it makes and chooses, and what it says of those that live."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import mutants
import mutate
import pytest
import yaml

TOOLS = Path(mutate.__file__).parent

MODULE = '''
class Door:
    def is_wide(self, width_m: float | None) -> bool:
        """Return whether robots fit."""
        limit_m = 1 + 0.0
        self.note(width_m)
        return width_m is not None and limit_m <= width_m
'''

TEST = """
from semmap_log.room.door import Door

class Noted(Door):
    def note(self, width_m): self.noted = width_m

def test_widths():
    assert [False, True, True] == [Noted().is_wide(m) for m in (0.5, 1.0, 1.5)]
"""


def functions(path: Path, text: str) -> list[mutants.Function]:
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(text)
    return list(mutants.functions_of(path))


def test_each_listed_survivor_has_a_reason_and_a_name_of_its_own() -> None:
    """Which says what it is: without effect, of speed alone, or what else."""
    listed = yaml.safe_load(mutate.SURVIVORS.read_text()) or []

    assert len(listed) == len({entry["mutant"] for entry in listed})
    assert [] == [entry for entry in listed if len(str(entry["reason"]).split()) < 3]
    assert all(entry["mutant"].count("/") == 2 and entry["change"] for entry in listed)


def test_a_function_is_known_by_its_code(tmp_path: Path) -> None:
    """In another file, below other lines, with another docstring or layout, it is the same."""
    (one,) = functions(tmp_path / "one.py", MODULE)
    moved = "MOST = 1\n" + MODULE.replace("whether robots fit", "True or False")
    (same,) = functions(tmp_path / "two.py", moved.replace("1 + 0.0", "(1 +  0.0)"))
    (other,) = functions(tmp_path / "three.py", MODULE.replace("<=", "<"))

    assert "Door.is_wide" == one.name
    assert one.digest == same.digest != other.digest
    assert moved.count("\n") == (same.before + same.text + same.after).count("\n")


def test_mutants_leave_annotations_alone_and_calls_out(tmp_path: Path) -> None:
    """What a type checker reads changes nothing that runs."""
    pytest.importorskip("cosmic_ray")
    (function,) = functions(tmp_path / "one.py", MODULE)

    changes = ["\n".join(mutant.change()) for _, mutant in mutants.mutants_of(function)]

    assert "- self.note(width_m)\n+ pass" in changes
    assert any("limit_m < width_m" in change for change in changes)
    assert not any("def is_wide" in change for change in changes)
    assert all(changes)


def test_a_seed_chooses_the_same_whatever_else_there_is(tmp_path: Path) -> None:
    """One place is taken once; another seed chooses others."""
    pytest.importorskip("cosmic_ray")
    (one,) = functions(tmp_path / "one.py", MODULE)
    (other,) = functions(tmp_path / "two.py", MODULE.replace("<=", ">="))

    chosen = mutants.chosen([one], 2, seed=1)

    assert 2 == len({mutant.key for mutant in chosen})
    both = mutants.chosen([other, one], 4, seed=1)
    assert {mutant.key for mutant in chosen} == {m.key for m in both if m.function == one}
    assert chosen != mutants.chosen([one], 2, seed=2)


@pytest.mark.slow
def test_what_lives_is_named_until_it_is_listed(tmp_path: Path) -> None:
    """Tests run in copies of a checkout; what no test notices is an error, or has a reason."""
    pytest.importorskip("cosmic_ray")
    (tmp_path / "tools").mkdir()
    for name in ("mutate.py", "mutants.py", "tests_of.py"):
        shutil.copy(TOOLS / name, tmp_path / "tools")
    for path, text in [
        ("semmap_log/room/door.py", MODULE),
        ("semmap_log/__init__.py", ""),
        ("semmap_log/room/__init__.py", ""),
        ("tests/room/test_door.py", TEST),
        ("tests/surviving_mutants.yaml", ""),
        ("pyproject.toml", ""),
    ]:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    command = [sys.executable, "tools/mutate.py", "--faults", "9", "--json", "semmap_log"]

    def run() -> tuple[int, dict[str, str]]:
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.stdout, done.stderr
        tried = json.loads(done.stdout)["mutants"]
        return done.returncode, {each["mutant"]: each["killer"] for each in tried}

    code, killers = run()

    assert (1, {"", "tests/room/test_door.py::test_widths"}) == (code, set(killers.values()))
    alive = [name for name in killers if not killers[name]]
    assert any("LeaveOutCall" in name for name in alive)
    listed = [{"mutant": name, "reason": "no test is about notes"} for name in alive]
    (tmp_path / "tests/surviving_mutants.yaml").write_text(yaml.safe_dump(listed))
    assert (0, {name: killer for name, killer in killers.items() if killer}) == run()
    assert MODULE == (tmp_path / "semmap_log/room/door.py").read_text()
