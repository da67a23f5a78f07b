"""Folders as values: read, written, kept for who wants to look."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

Tree: TypeAlias = "Mapping[str, bytes | Tree]"
"""A folder's content: name -> a file's bytes, or a folder."""


def read_tree(folder: Path) -> Tree:
    """Return what is in a folder."""
    return {
        path.name: read_tree(path) if path.is_dir() else path.read_bytes()
        for path in folder.iterdir()
    }


def write_tree(folder: Path, tree: Tree) -> None:
    """Make a folder of that content, in place of any that is there."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    for name, content in tree.items():
        if isinstance(content, bytes):
            (folder / name).write_bytes(content)
        else:
            write_tree(folder / name, content)


def keep(folder: Path, fault: str, tree: Tree) -> Path:
    """Put a content into a subfolder named after the fault that left it, and return that."""
    kept = folder.resolve() / hashlib.sha256(fault.encode()).hexdigest()[:12]
    write_tree(kept, tree)
    (kept / "fault.txt").write_text(fault + "\n")
    return kept
