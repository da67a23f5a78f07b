"""What needs an extra: nothing but what draws, signs, tabulates for other programs, or runs SQL."""

from __future__ import annotations

import subprocess
import sys

NEED_AN_EXTRA = {
    "semmap_log.analysis.sql",
    "semmap_log.core.arrow",
    "semmap_log.fleet.jobs",
    "semmap_log.log.door_log.arrow_tables",
    "semmap_log.log.signing",
    "semmap_log.views.fleet_tables",
    "semmap_log.views.plots",
    "semmap_log.views.rerun",
    "semmap_log.views.sql_answer_table",
}
WITHOUT_EXTRAS = """
import pkgutil, re, sys, tomllib
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.metadata import packages_distributions

with open("pyproject.toml", "rb") as file:
    project = tomllib.load(file)["project"]
name_of = lambda line: re.match("[A-Za-z0-9_-]+", line)[0].lower().replace("_", "-")
core = set(map(name_of, project["dependencies"]))
extras = {name_of(line) for lines in project["optional-dependencies"].values() for line in lines}
of_extras = {
    module
    for module, made_by in packages_distributions().items()
    if {name.lower().replace("_", "-") for name in made_by} & (extras - core)
}

class Core(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        is_there = name.partition(".")[0] not in of_extras
        return super().find_spec(name, path, target) if is_there else None

sys.meta_path[sys.meta_path.index(PathFinder)] = Core
import semmap_log

for module in pkgutil.walk_packages(semmap_log.__path__, "semmap_log."):
    if module.name != "semmap_log.__main__":
        try:
            import_module(module.name)
        except ImportError as error:
            print(module.name, str(error).replace("\\n", " "))
"""


def test_only_what_draws_signs_tabulates_or_runs_sql_needs_an_extra() -> None:
    """
    And it names the line that installs it.
    """
    run = subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTRAS], capture_output=True, text=True, check=True
    )
    why = dict(line.split(" ", 1) for line in run.stdout.splitlines())

    unlisted = [name for name in why if not any(name.startswith(part) for part in NEED_AN_EXTRA)]
    unused = [part for part in NEED_AN_EXTRA if not any(name.startswith(part) for name in why)]
    unclear = [name for name, said in why.items() if "pip install 'semmap-log[" not in said]
    assert (unlisted, unused, unclear) == ([], [], [])
