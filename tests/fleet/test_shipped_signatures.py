"""Signatures and stores: what was signed on the robot's disk is checked where the log lies."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import pytest

from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import SigningError
from semmap_log.fleet.fetching import fetch
from semmap_log.fleet.keeping import remove_shipped
from semmap_log.fleet.shipping import ship
from semmap_log.log.signing.log_signing import sign
from semmap_log.log.signing.signed_log import verify_signed
from tests.fleet.test_shipping import a_log
from tests.log.signing.signed_logs import a_key, believed, is_good


def test_a_shipped_log_is_checked_where_it_lies(bucket: str, tmp_path: Path) -> None:
    """At its URL, and fetched, with the signatures that were kept beside the log."""
    log, key = a_log(tmp_path / "log", 2), a_key(tmp_path)
    sign(log, key)
    ship(log, UrlPath(bucket))
    fetch(UrlPath(bucket), tmp_path / "fetched")
    kept = [log / "signatures"]

    for place in (UrlPath(bucket), tmp_path / "fetched"):
        assert 0 == verify_signed(place, believed(key), elsewhere=kept).found.exit_code
        assert 4 == verify_signed(place, believed(key)).found.exit_code
    shutil.copytree(log / "signatures", tmp_path / "fetched" / "signatures")
    assert is_good(tmp_path / "fetched", key)


def test_a_part_that_was_removed_here_is_vouched_for_by_what_follows(
    bucket: str, tmp_path: Path
) -> None:
    """What was read is compared; what lies in the store only is named."""
    log, key = a_log(tmp_path / "log", 4), a_key(tmp_path)
    sign(log, key)
    ship(log, UrlPath(bucket))
    remove_shipped(log, ObjectStore(UrlPath(bucket)), time.time_ns())

    found = verify_signed(log, believed(key)).found

    assert 0 == found.exit_code
    assert found.first_event > 0
    assert [] == sign(log, key).made
    with pytest.raises(SigningError, match="are missing, or elsewhere"):
        sign(log, a_key(tmp_path, "new"))
