"""The thesis's SaveDoorDB: a YAML of the doors, in one folder and nowhere else.

Whoever is in the ROS network may send the goal, so its file name is a stranger's. Each part of it
is opened from the part before (`O_NOFOLLOW`), and the file is named within the folder that was
opened last: whoever exchanges a folder for a link meanwhile gains nothing.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import NoReturn

from semmap_log.core.io.disk import refuse_own_folder, replace_file
from semmap_log.core.model.doors import DoorMap
from semmap_log.errors import OutputError
from semmap_log.interop.formats.files.thesis_yaml import SAVED_SUFFIX, dump_thesis_yaml

SUFFIXES = (".yaml", ".yml")


class DoorSaver:
    """Writes doors into a folder."""

    def __init__(
        self, root: Path | None, log_folder: Path, *, default_prob: float | None = None
    ) -> None:
        """Choose where.

        Args:
            root: The folder; its own name may be a link. None: one beside the log, named as it
                is with `_saved` behind, which is made when it is needed.
            log_folder: Where nothing is written.
            default_prob: Stands for probabilities that were not given; None: their lines are left
                out.
        """
        own = Path(os.path.abspath(log_folder))  # noqa: PTH100  without its `..`, through no link
        self._makes_root = root is None
        self._root = own.with_name(own.name + SAVED_SUFFIX) if root is None else root.absolute()
        self._log_folder = log_folder
        self._default_prob = default_prob

    def told(self) -> str:
        """Return where files are saved, or why none can be."""
        makes = self._makes_root and not self._root.exists()
        if os.access(self._root.parent if makes else self._root, os.W_OK | os.X_OK):
            return f"SaveDoorDB saves in {self._root}."
        return (
            f"warning: SaveDoorDB cannot save in {self._root}: this process may not write there; "
            "--save-root DIR gives another folder."
        )

    def save(self, file_name: str, doors: DoorMap) -> list[str]:
        """Write the doors, whole or not at all; return what is left out of which, and why.

        Args:
            file_name: Within the root, or absolute and inside it.
            doors: The doors.

        Raises:
            OutputError: The name leads out of the root, or the file cannot be written; what was
                there is whole.
        """
        *folders, name = self._parts(file_name)
        text, left_out = dump_thesis_yaml(doors, default_prob=self._default_prob, is_partial=True)
        try:
            if self._makes_root:
                self._root.mkdir(exist_ok=True)
            with self._opened(folders, file_name) as folder:
                self._check_place(folder, name, file_name)
                replace_file(folder / name, text.encode())
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            self._refuse(file_name, f"could not be written: {error.strerror or error}")
        return left_out

    def _parts(self, file_name: str) -> tuple[str, ...]:
        """Return the folders below the root, and the file's name."""
        path = PurePosixPath(file_name)
        if not file_name.isprintable() or ".." in path.parts:
            self._refuse(file_name, "a name without .. and control characters is expected")
        if path.is_absolute():
            inside = [root for root in (self._root, self._root.resolve())
                      if path.is_relative_to(root)]  # fmt: skip
            if not inside:
                self._refuse(file_name, "lies outside")
            path = path.relative_to(inside[0])
        if path.suffix not in SUFFIXES:
            self._refuse(file_name, f"a name in {' or '.join(SUFFIXES)} is expected")
        return path.parts

    @contextmanager
    def _opened(self, folders: Sequence[str], file_name: str) -> Iterator[Path]:
        """Hand out a path of the folder that stays the same, whatever becomes of the names."""
        descriptor = os.open(self._root, _FOLDER)
        try:
            for part in folders:
                try:
                    below = os.open(part, _FOLDER | os.O_NOFOLLOW, dir_fd=descriptor)
                except NotADirectoryError:
                    self._refuse(file_name, f"{part!r} is a link, or no folder")
                os.close(descriptor)
                descriptor = below
            yield Path(f"/proc/self/fd/{descriptor}")
        finally:
            os.close(descriptor)

    def _check_place(self, folder: Path, name: str, file_name: str) -> None:
        """Return if a file may be put there: nothing is, or a file; and no log is beside it."""
        try:
            mode = (folder / name).lstat().st_mode
        except FileNotFoundError:
            mode = stat.S_IFREG
        if not stat.S_ISREG(mode):
            self._refuse(file_name, "a link, folder or device has that name")
        refuse_own_folder(self._log_folder, folder.resolve() / name)
        if any(each.suffix == ".mcap" for each in folder.iterdir()):
            self._refuse(file_name, "lies in the folder of a log")

    def _refuse(self, file_name: str, why: str) -> NoReturn:
        raise OutputError(
            f"file_name: {file_name!r}: {why}; files are saved in {self._root} (another: "
            "--save-root at the server's start). Nothing was written."
        )


_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
