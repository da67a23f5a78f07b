"""Exported files as one table of a lake: Delta's or Iceberg's, committed once, at the end of a run.

The files stay where they are. What an earlier run has put into the table and this one has not (a
log has grown since) is taken out by the same commit: a reader sees the lake as it was, or as it is.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from semmap_log.errors import EngineError
from semmap_log.fleet.jobs.lake_folder import LAKE_SCHEMA, MONTH, LakeFile, log_of, month_of


def commit_delta(out: str, files: Sequence[LakeFile]) -> None:
    """Make the table at a lake's folder have these files of their logs, and no others of them.

    Files that the table does not have any more lie there until its `vacuum` removes them.

    Raises:
        EngineError: deltalake is not installed, or refuses.
    """
    deltalake: Any = _module("deltalake", "deltalake")
    writing: Any = import_module("deltalake.transaction")
    options = {"allow_http": "true"} if "http://" in os.environ.get("AWS_ENDPOINT_URL", "") else {}
    schema = LAKE_SCHEMA.append(MONTH)
    try:
        if deltalake.DeltaTable.is_deltatable(out, storage_options=options):
            table = deltalake.DeltaTable(out, storage_options=options)
        else:
            table = deltalake.DeltaTable.create(
                out, schema, partition_by=["month"], name="semmap_log_events",
                storage_options=options,
            )  # fmt: skip
        there = {row["path"]: row for row in _rows(table.get_add_actions(flatten=True))}
        ours, logs = {file.path for file in files}, {file.log_id for file in files}
        new = [file for file in files if file.path not in there]
        old = [path for path in there if path not in ours and log_of(path) in logs]
        now_ms = int(time.time() * 1000)
        actions = [
            writing.AddAction(f.path, f.bytes, {"month": f.month}, now_ms, True, _stats_of(f))
            for f in new
        ] + [
            writing.RemoveAction(
                path, True, now_ms, there[path]["size_bytes"], {"month": month_of(path)}
            )
            for path in old
        ]  # fmt: skip
        if actions:
            table.create_write_transaction(actions, "append", schema, ["month"])
    except (deltalake.exceptions.DeltaError, OSError, ValueError) as error:
        raise EngineError(f"{out}: no commit to the Delta table: {error}") from None


def commit_iceberg(name: str, out: str, files: Sequence[LakeFile]) -> None:
    """Make a table of a catalog have these files of their logs, and no others of them.

    Args:
        name: `catalog.namespace.table`; pyiceberg knows the catalog by its own file or environment.
        out: The lake's folder, absolute, or its URL.
        files: Of an export.

    Raises:
        EngineError: pyiceberg is not installed, knows no such catalog, or refuses.
    """
    catalogs: Any = _module("pyiceberg.catalog", "'pyiceberg[sql-sqlite]'")
    catalog_name, dot, identifier = name.partition(".")
    if not dot or "." not in identifier:
        raise EngineError(f"--iceberg {name}: expected CATALOG.NAMESPACE.TABLE.")
    try:
        catalog = catalogs.load_catalog(catalog_name)
        catalog.create_namespace_if_not_exists(identifier.rpartition(".")[0])
        table = catalog.create_table_if_not_exists(identifier, schema=LAKE_SCHEMA)
        there = {path.removeprefix("file://") for path in _paths(table)}
        ours = {f"{out}/{file.path}": file for file in files}
        logs = {file.log_id for file in files}
        old = [path for path in there if path not in ours and log_of(path) in logs]
        changed = {log_of(path) for path in old}
        new = [path for path, f in ours.items() if path not in there or f.log_id in changed]
        with table.transaction() as commit:
            if changed:
                expressions: Any = import_module("pyiceberg.expressions")
                commit.delete(expressions.In("log_id", sorted(changed)))
            if new:
                commit.add_files(new, check_duplicate_files=False)
    except Exception as error:  # noqa: BLE001  pyiceberg's errors have no common class
        raise EngineError(f"--iceberg {name}: no commit: {type(error).__name__}: {error}") from None


def _module(name: str, install: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise EngineError(
            f"{package} is not installed; install it with: pip install {install}"
        ) from None


def _rows(table: Any) -> list[dict[str, Any]]:
    from semmap_log.core.arrow.arrow_sdk import pa

    rows: list[dict[str, Any]] = pa.table(table).to_pylist()
    return rows


def _paths(table: Any) -> list[str]:
    paths: list[str] = table.inspect.files()["file_path"].to_pylist()
    return paths


def _stats_of(file: LakeFile) -> str:
    """Return what lets a reader skip a file."""
    ends = {"log_id": file.log_id}
    return json.dumps(
        {
            "numRecords": file.events,
            "minValues": ends,
            "maxValues": ends,
            "nullCount": {"log_id": 0},
        }
    )
