"""A ROS package's interfaces: the definitions in its folders msg, srv and action."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from graphlib import TopologicalSorter
from pathlib import Path

SUFFIXES = (".msg", ".srv", ".action")
_QUALIFIED = re.compile(r"^\s*(\w+)/\w+", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class InterfacePackage:
    """A folder whose name is the package's."""

    folder: Path

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def definitions(self) -> list[Path]:
        """Return its .msg, .srv and .action files, messages first."""
        return sorted(
            (path for path in self.folder.glob("*/*") if path.suffix in SUFFIXES),
            key=lambda path: (SUFFIXES.index(path.suffix), path.name),
        )

    @property
    def named_packages(self) -> set[str]:
        """Return the other packages whose types its definitions name."""
        texts = (path.read_text(encoding="utf-8") for path in self.definitions)
        return {name for text in texts for name in _QUALIFIED.findall(text)} - {self.name}


def in_order(packages: Iterable[InterfacePackage]) -> list[InterfacePackage]:
    """Return them so that each comes after those it needs."""
    known = {package.name: package for package in packages}
    needs = {name: sorted(package.named_packages & set(known)) for name, package in known.items()}
    return [known[name] for name in TopologicalSorter(needs).static_order()]
