"""What the head of a segment says of its log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.moments import USUAL_HOLDS
from semmap_log.errors import InvalidEventError
from semmap_log.store.byte_layout import NO_HASH
from semmap_log.store.header import LogInfo, SegmentHeader
from semmap_log.store.manifest import Manifest, manifest_in
from semmap_log.store.reading.manifest_entry import manifest_entry
from semmap_log.store.reading.segment_scan import open_segment
from tests.store.logs import segment_files

INFO = LogInfo("ab" * 16, "UTC", "depot", "tug1")
HEADER = SegmentHeader(INFO, 0, 0, NO_HASH)


@pytest.mark.parametrize("holds", [0, 1, 12, 10**9 - 1])
def test_how_long_a_sighting_holds_is_read_as_it_was_written(holds: int) -> None:
    """And is no entry of a later version."""
    header = replace(HEADER, info=replace(INFO, holds=holds))

    found = SegmentHeader.from_metadata(header.to_metadata())

    assert header == found
    assert not found.is_newer


def test_the_usual_setting_is_not_written() -> None:
    """So the head of a log is, byte for byte, what older versions wrote and read."""
    assert "holds" not in HEADER.to_metadata().metadata
    assert "holds" in replace(HEADER, info=replace(INFO, holds=2)).to_metadata().metadata


@pytest.mark.parametrize("said", ["", "-1", "3.5", "9" * 10, "x", "٣"])
def test_a_setting_that_is_none_is_damage(said: str) -> None:
    """It is not what we write."""
    with pytest.raises(ValueError, match="holds is "):
        LogInfo.taken_from(INFO.entries() | {"holds": said})


@pytest.mark.parametrize("holds", [-1, 10**9])
def test_a_log_with_another_setting_is_not_made(holds: int, tmp_path: Path) -> None:
    """It is said what was expected."""
    with pytest.raises(InvalidEventError, match="expected 0 to 999999999 gaps"):
        sl.create(tmp_path / "log", holds=holds)

    assert not (tmp_path / "log").exists()


def test_a_store_keeps_the_setting(tmp_path: Path) -> None:
    """Its manifest says it, like the heads of the segments that it names."""
    with sl.create(tmp_path / "log", holds=7) as log:
        log.add_door()
    manifest = manifest_of(tmp_path / "log")

    found = manifest_in(manifest.text().encode(), tmp_path)

    assert manifest == found
    assert found.info.holds == found.segments[0].header.info.holds == 7


def test_what_an_older_program_shipped_is_the_same(tmp_path: Path) -> None:
    """It did not know the setting, and kept it among the entries of later versions."""
    with sl.create(tmp_path / "log", holds=7) as log:
        log.add_door()
    manifest = manifest_of(tmp_path / "log")
    (told,) = manifest.segments
    info = replace(manifest.info, holds=USUAL_HOLDS)
    header = replace(told.header, info=info, others=(("holds", "7"),))
    older = replace(manifest, info=info, segments=(replace(told, header=header),))

    assert manifest == manifest_in(older.text().encode(), tmp_path)


def manifest_of(log: Path) -> Manifest:
    (file,) = segment_files(log)
    segment = open_segment(file)
    entry = manifest_entry(segment, "0-ab.mcap", "ab" * 32)
    return Manifest(1, segment.full_header.info, (entry,))
