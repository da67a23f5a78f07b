"""The thesis's goals, checked, and its SaveDoorDB: a YAML of the doors, in one folder only.

Whoever is in the ROS network may send the goal, so its file name is not trusted. Each part of it
is opened from the part before (`O_NOFOLLOW`), and the file is named within the folder that was
opened last: whoever exchanges a folder for a link meanwhile gains nothing.
"""

from __future__ import annotations

import math
import os
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn, TypeAlias

from semmap_log.core.io.disk import check_outside_log, replace_file
from semmap_log.core.model import doors as door_model
from semmap_log.errors import InvalidEventError, OutputError
from semmap_log.interop.formats.files.thesis_yaml import SAVED_SUFFIX, dump_thesis_yaml
from semmap_log.live.ros.ros_node import Values

SUFFIXES = (".yaml", ".yml")


class DoorSaver:
    """Writes doors into a folder."""

    def __init__(
        self, root: Path | None, log_folder: Path, *, default_prob: float | None = None
    ) -> None:
        """Choose where.

        Args:
            root: The folder; its own name may be a link. None: one next to the log, with its name
                and the suffix `_saved`, which is made when it is needed.
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

    def save(self, file_name: str, doors: door_model.DoorMap) -> list[str]:
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
        """Check that a file may be put there: there is nothing or a file, and no log next to it."""
        try:
            mode = (folder / name).lstat().st_mode
        except FileNotFoundError:
            mode = stat.S_IFREG
        if not stat.S_ISREG(mode):
            self._refuse(file_name, "a link, folder or device has that name")
        check_outside_log(self._log_folder, folder.resolve() / name)
        if any(each.suffix == ".mcap" for each in folder.iterdir()):
            self._refuse(file_name, "lies in the folder of a log")

    def _refuse(self, file_name: str, why: str) -> NoReturn:
        raise OutputError(
            f"file_name: {file_name!r}: {why}; files are saved in {self._root} (another: "
            "--save-root at the server's start). Nothing was written."
        )


_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC


Place: TypeAlias = tuple[float, float, float]
"""x, y (metres) and theta (radians), frame `map`."""


@dataclass(frozen=True, slots=True)
class AddAsk:
    """A door is to come into the map."""

    place: Place
    width: float
    state: door_model.DoorState
    prob_open: float
    """NaN: not given."""
    prob_closed: float


@dataclass(frozen=True, slots=True)
class UpdateAsk:
    """Values of a door are to be set; None: that one is to stay as it is."""

    door_id: door_model.DoorId
    place: Place | None
    width: float | None
    state: door_model.DoorState | None
    prob_open: float | None
    prob_closed: float | None


@dataclass(frozen=True, slots=True)
class RemoveAsk:
    """A door is to leave the map."""

    door_id: door_model.DoorId


@dataclass(frozen=True, slots=True)
class SaveAsk:
    """The doors are to be written to a file."""

    file_name: str


Ask: TypeAlias = AddAsk | UpdateAsk | RemoveAsk | SaveAsk


def read_goal(action: str, values: Values) -> tuple[Ask, list[str]]:
    """Return what a goal asks for, and what is odd about it.

    Args:
        action: Its type without the package, such as `AddDoor`.
        values: Its fields; those left out have ROS's defaults.

    Raises:
        InvalidEventError: A field that counts has a value that no door can have.
    """
    fields = _Fields(values, [])
    return _READERS[action](fields), fields.warnings


@dataclass(frozen=True, slots=True)
class _Fields:
    """Takes values out of a goal, and notes what is odd about them."""

    values: Mapping[str, Any]
    warnings: list[str]

    def add(self) -> AddAsk:
        return AddAsk(
            self.place(),
            self.width(),
            self.state(),
            self.probability("prob_open"),
            self.probability("prob_closed"),
        )

    def update(self) -> UpdateAsk:
        return UpdateAsk(
            self.door_id(),
            self.place() if self.is_set("change_pos") else None,
            self.width() if self.is_set("change_width") else None,
            self.state() if self.is_set("change_open") else None,
            self.new_probability("prob_open"),
            self.new_probability("prob_closed"),
        )

    def remove(self) -> RemoveAsk:
        return RemoveAsk(self.door_id())

    def save(self) -> SaveAsk:
        return SaveAsk(str(self.values.get("file_name", "")))

    def is_set(self, name: str) -> bool:
        return bool(self.values.get(name, False))

    def number(self, name: str) -> float:
        return float(self.values.get(name, 0.0))

    def door_id(self) -> door_model.DoorId:
        """Return the id: the goal's field has 64 bits, an id 32."""
        door_id = int(self.values.get("door_id", 0))
        if not 0 <= door_id <= door_model.MAX_DOOR_ID:
            _refuse("door_id", f"a whole number from 0 to {door_model.MAX_DOOR_ID}", door_id)
        return door_model.DoorId(door_id)

    def place(self) -> Place:
        for name in ("pos_x", "pos_y", "pos_theta"):
            if not math.isfinite(self.number(name)):
                unit = "radians" if name == "pos_theta" else "metres"
                _refuse(name, f"a finite number of {unit}", self.number(name))
        return self.number("pos_x"), self.number("pos_y"), self.number("pos_theta")

    def width(self) -> float:
        width = self.number("width")
        if not (math.isfinite(width) and width >= 0):
            _refuse("width", "a finite number of metres, 0 or more", width)
        return width

    def state(self) -> door_model.DoorState:
        """Return the state, in any case of letters; a text that is none is UNKNOWN (4.2.2)."""
        text = str(self.values.get("door_state", ""))
        known = door_model.thesis_state(text)
        if known is None:
            self.warnings.append(
                f"door_state: expected one of {', '.join(door_model.THESIS_STATES)}, got {text!r}; "
                "taken for UNKNOWN."
            )
        return door_model.DoorState.UNKNOWN if known is None else known

    def probability(self, name: str) -> float:
        value = self.number(name)
        if math.isnan(value):
            return door_model.NAN
        if not 0 <= value <= 1:
            _refuse(name, "a number from 0 to 1, or NaN where none is given", value)
        return value

    def new_probability(self, name: str) -> float | None:
        """Return what a probability is to become.

        NaN is not given, and what is not given stays: a mean of no sightings, 0/0, must not wipe
        out what is known.
        """
        if not self.is_set(f"change_{name}"):
            return None
        value = self.probability(name)
        if math.isnan(value):
            self.warnings.append(f"{name}: NaN means not given; it stays as it is.")
            return None
        return value


_READERS: Mapping[str, Callable[[_Fields], Ask]] = {
    "AddDoor": _Fields.add,
    "UpdateDoor": _Fields.update,
    "RemoveDoor": _Fields.remove,
    "SaveDoorDB": _Fields.save,
}


def _refuse(name: str, expected: str, got: object) -> NoReturn:
    raise InvalidEventError(name, expected, got)
