"""Files made to do harm: each is read in a child with little memory and little time.

Whatever they are, the child says FormatError; it is never killed by a signal, never runs out of
memory or time.
"""

import gzip
import os
import subprocess
import sys
import zlib
from base64 import b64encode

import pytest

MEMORY_BYTES = 512 * 2**20
SECONDS = 200
"""Of work: the slowest kind takes thirty on an idle core, and what is not bounded never ends."""

CHILD = f"""
import resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_AS, ({MEMORY_BYTES}, {MEMORY_BYTES}))
resource.setrlimit(resource.RLIMIT_CPU, ({SECONDS}, {SECONDS}))
from semmap_log.core.model.doors import DoorMap
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building import read_building
from semmap_log.interop.formats.files.door_csv import read_door_csv
from semmap_log.interop.importing.import_plan import Present
from semmap_log.interop.importing.importing_lines import plan_event_lines
from semmap_log.interop.formats.files.map_server import read_map
from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml
from tests.interop.importing.nothing_stored import NothingStored, lines_of
empty = Present(DoorMap({{}}, {{}}), frozenset())
readers = {{
    "yaml": [read_thesis_yaml, read_building, read_map],
    "csv": [lambda path: read_door_csv(path, tz="UTC")],
    "jsonl": [
        lambda path: plan_event_lines(path, empty, lines_of("UTC"), NothingStored(), now_ns=0)
    ],
}}
for path in map(Path, sys.argv[1:]):
    some = readers[path.suffix[1:]]
    for read in some[:1] if path.name.startswith("wide") else some:
        try:
            read(path)
        except FormatError as error:
            assert str(error).startswith(str(path)), error
            print(str(error)[:300])
        else:
            sys.exit(f"{{path}} was read")
print("all", len(sys.argv) - 1)
"""

M = 8 * 2**20 - 64


def alias_bomb():
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    return "\n".join(lines).encode()


def merge_bomb():
    lines = ["a0: &a0 {x: 1}"]
    lines += [f"a{n}: &a{n} {{<<: [*a{n - 1}, *a{n - 1}]}}" for n in range(1, 25)]
    return "\n".join(lines).encode()


def floor_map_bomb():
    packed = zlib.compress(bytes(300 * 2**20), 1)
    return (
        b'{"kind": "FloorMap", "level": 0, "resolution": 1, "origin_x": 0, "origin_y": 0,'
        b'"width": 10, "height": 10, "cells_zlib_base64": "' + b64encode(packed) + b'"}'
    )


def gzip_bomb():
    return gzip.compress(b"timestamp,door,state\n" + bytes(200 * 2**20))


HOSTILE = {
    "keys-twice.yaml": lambda: b"1: {width: 1}\n1: {width: 2}\n",
    "aliases.yaml": alias_bomb,
    "merge-keys.yaml": merge_bomb,
    "an-alias-of-itself.yaml": lambda: b"a: &a [*a]\n",
    "deep-lists.yaml": lambda: b"[" * 100_000,
    "deep-lists-of-8-MiB.yaml": lambda: b"[" * M,
    "deep-maps.yaml": lambda: b"{a: " * (M // 4),
    "deep-blocks.yaml": lambda: b"- " * (M // 2),
    "deep-keys.yaml": lambda: b"? " * (M // 2),
    "wide-list.yaml": lambda: b"[" + b"1," * (M // 2) + b"]",
    "wide-list-of-lists.yaml": lambda: b"[" + b"[]," * (M // 3) + b"]",
    "one-long-text.yaml": lambda: b"a" * M,
    "one-long-number.yaml": lambda: b"1: " + b"9" * (M - 9),
    "nan.yaml": lambda: b"1: {position: {x: .nan, y: 0, theta: 0}, width: 1}\n",
    "huge-float.yaml": lambda: b"1: {width: 1e400}\n",
    "two-documents.yaml": lambda: b"--- {}\n--- {}\n",
    "tags.yaml": lambda: b"!!python/object/apply:os.system [true]\n",
    "utf-16.yaml": lambda: "1: {}\n".encode("utf-16"),
    "latin-1.yaml": lambda: "Tür: {}\n".encode("latin-1"),
    "zeros.yaml": lambda: bytes(M),
    "many-wrong-doors.yaml": lambda: b"".join(b"x%d: {}\n" % n for n in range(100_000)),
    "zeros.csv": lambda: bytes(M),
    "gzip-bomb.csv": gzip_bomb,
    "one-cell.csv": lambda: b'timestamp,door,state\n"' + b"a\n" * (M // 2),
    "many-wrong-rows.csv": lambda: b"timestamp,door,state\n" + b"x,y,z\n" * (M // 6),
    "deep.jsonl": lambda: b"[" * M,
    "deep-objects.jsonl": lambda: b'{"a":' * (M // 5),
    "huge-number.jsonl": lambda: b"9" * M,
    "keys-twice.jsonl": lambda: b'{"kind": "DoorRemoved", "door_id": 1, "door_id": 1}',
    "floor-map-bomb.jsonl": floor_map_bomb,
}


def read_in_child(*paths):
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, "-c", CHILD, *paths], env=environment, capture_output=True, text=True,
        timeout=500, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("suffix", ["yaml", "csv", "jsonl"])
def test_a_hostile_file_is_an_error_and_no_more(tmp_path, suffix):
    """512 MiB of memory, and an end."""
    paths = [tmp_path / name for name in HOSTILE if name.endswith(suffix)]
    for path in paths:
        path.write_bytes(HOSTILE[path.name]())

    child = read_in_child(*paths)

    assert (0, "") == (child.returncode, child.stderr[-2000:])
    assert child.stdout.endswith(f"all {len(paths)}\n")


def test_a_file_of_100_megabytes_is_an_error_and_no_more(tmp_path):
    """It is never read."""
    path = tmp_path / "large.yaml"
    path.write_bytes(b"1: {}\n")
    os.truncate(path, 100 * 2**20)

    child = read_in_child(path)

    assert (0, "") == (child.returncode, child.stderr[-2000:])
    assert "expected at most 8 MiB" in child.stdout
