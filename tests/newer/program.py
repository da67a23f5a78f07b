"""A later version of this program: a copy of its sources in which somebody has added something.

It runs in a process of its own and writes real logs; the tests are the older program that meets
them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import semmap_log
from semmap_log.store.byte_layout import KINDS_OF_MINOR

MESSAGE = "uint32 door_id\nfloat64 strength\n"
KIND = '''
@dataclass(frozen=True, slots=True, kw_only=True)
class {name}(DoorEvent):
    """A kind of a later version."""

    {mark}
    strength: float = 0.0


AnyEvent: TypeAlias = (
'''


@dataclass(frozen=True)
class Later:
    """What a later version has more than this one."""

    kind: str = ""
    """The name of a kind; empty: none."""
    is_marked: bool = False
    """Whether that says that it changes nothing."""
    minors: int = 1
    """How many more minor versions there are."""
    major: str = "3"
    has_entry: bool = False
    """Whether the Metadata `semmap_log` has one more entry."""


def install(folder: Path, later: Later) -> Path:
    """Make such a program in a folder, and return that."""
    package = folder / "semmap_log"
    ignored = shutil.ignore_patterns("__pycache__", "robot_files", "cli", "views")
    shutil.copytree(Path(semmap_log.__file__).parent, package, ignore=ignored)
    if later.kind:
        _add_kind(package, later)
    have = KINDS_OF_MINOR[-1] + bool(later.kind)
    counts = (
        (*KINDS_OF_MINOR, *[have] * later.minors) if later.minors else (*KINDS_OF_MINOR[:-1], have)
    )
    form, header = package / "store" / "byte_layout.py", package / "store" / "header.py"
    edit(form, f"KINDS_OF_MINOR = {KINDS_OF_MINOR}", f"KINDS_OF_MINOR = {counts}")
    edit(form, 'FORMAT_VERSION = "3"', f'FORMAT_VERSION = "{later.major}"')
    if later.has_entry:
        written = "                **minor,\n"
        edit(header, written, f'{written}                "site": "west",\n')
        read = '            minor = int(entries.pop(_MINOR_KEY, "0"))\n'
        edit(header, read, f'{read}            entries.pop("site", None)\n')
    return folder


def run(program: Path, script: str, *arguments: object) -> str:
    """Run a script in that program, and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", script, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(program), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
        cwd=program,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def _add_kind(package: Path, later: Later) -> None:
    name, messages = later.kind, package / "core" / "messages"
    (messages / "msg" / f"{name}.msg").write_text(MESSAGE, encoding="ascii")
    mark = "changes_nothing = True" if later.is_marked else ""
    events = package / "core" / "model" / "events.py"
    edit(events, "\nAnyEvent: TypeAlias = (\n", KIND.format(name=name, mark=mark))
    edit(events, "    | UnknownEvent\n)", f"    | {name}\n    | UnknownEvent\n)")


def edit(path: Path, old: str, new: str) -> None:
    """Replace a text that stands there once."""
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{path.name}: {old!r}"
    path.write_text(text.replace(old, new), encoding="utf-8")
