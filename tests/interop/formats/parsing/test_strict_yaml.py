"""YAML as we accept it: plain values with lines; what readers disagree about is an error."""

import math
import os
from pathlib import Path

import pytest

from semmap_log.errors import FormatError
from semmap_log.interop.formats.parsing.strict_yaml import (
    Mapping,
    Scalar,
    Sequence,
    load_yaml,
    parse_yaml,
    resolve,
)

HERE = Path("some.yaml")


def refused(text: str | bytes) -> str:
    data = text.encode() if isinstance(text, str) else text
    with pytest.raises(FormatError) as caught:
        parse_yaml(data, HERE)
    return str(caught.value)


def test_every_value_and_key_knows_its_line():
    """Lines count from 1, for keys, for values and for the items of lists."""
    root = parse_yaml(b"# doors\na: 1\nb:\n  - x\n  - 'y'\n", HERE)

    assert isinstance(root, Mapping)
    assert {"a": 2, "b": 3} == root.key_lines
    assert Scalar(2, 1, "1") == root.entries["a"]
    assert Sequence(4, [Scalar(4, "x", "x"), Scalar(5, "y", "y")]) == root.entries["b"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1), ("-7", -7), ("+7", 7), ("0", 0), ("1.5", 1.5), (".5", 0.5), ("5.", 5.0),
        ("1e-3", 0.001), ("1e-05", 1e-05), ("1E+3", 1000.0), ("-1.5e10", -1.5e10),
        ("true", True), ("False", False), ("null", None), ("~", None), ("", None),
        ("yes", "yes"), ("no", "no"), ("on", "on"), ("1:30", "1:30"), ("2001-01-01", "2001-01-01"),
        ("010", "010"), ("0x1F", "0x1F"), ("0o17", "0o17"), ("1_000", "1_000"), ("nan", "nan"),
        ("inf", "inf"), ("-", "-"), ("+", "+"), (".", "."), ("1e", "1e"), ("e3", "e3"),
    ],
)  # fmt: skip
def test_plain_scalars_follow_yaml_1_2(text, value):
    """Numbers are decimal, `1e-3` is one, and what only YAML 1.1 takes for more is text."""
    found = resolve(text)

    assert (value, type(value)) == (found, type(found))


def test_quoted_scalars_are_text():
    """Quotes make a text of a number, a truth and of nothing."""
    root = parse_yaml(b"""["1", 'true', "", '.nan', "<<"]""", HERE)

    assert isinstance(root, Sequence)
    assert ["1", "true", "", ".nan", "<<"] == [item.value for item in root.items]


def test_an_empty_file_is_nothing():
    """No document at all, and one with nothing in it, read alike."""
    assert Scalar(1, None, "") == parse_yaml(b"", HERE)
    assert Scalar(1, None, "") == parse_yaml(b"# only a comment\n", HERE)


def test_a_byte_order_mark_is_tolerated():
    """Editors on Windows write one."""
    root = parse_yaml(b"\xef\xbb\xbfa: 1\n", HERE)

    assert isinstance(root, Mapping)
    assert ["a"] == list(root.entries)


def test_a_key_twice_names_both_lines():
    """Loaders let the last one win silently."""
    assert "some.yaml:3: key '1'" in refused("1: a\n2: b\n'1': c\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: &x 1\nb: *x\n", "some.yaml:1: anchors and aliases"),
        ("a: *x\n", "anchors and aliases"),
        ("b: 1\n<<: {a: 1}\n", "some.yaml:2: merge keys"),
        ("a: !!python/object:os.system x\n", "some.yaml:1: tags"),
        ("a: !!int '1'\n", "tags"),
        ("a: 1\n---\nb: 2\n", "some.yaml:2: expected one document"),
        ("? [a, b]\n: 1\n", "expected a key that is a single value"),
        ("a: .nan\n", "some.yaml:1: expected a finite number, got .nan: .* leave its key out"),
        ("a: -.inf\n", "expected a finite number, got -.inf"),
        ("a: 1e400\n", "expected a number below 1.8e308, got '1e400'"),
        ("a: " + "1" * 5000, "at most 4000 digits, got 5000"),
        ("[" * 100, "at most 32 levels of nesting"),
        ("a: [1,\n", "not YAML: "),
        ("a: 1\nb: \x07\n", "some.yaml:2: not YAML: character #x0007 is not allowed"),
        (b"a: 1\nb: \xff\n", "some.yaml:2: expected UTF-8 text, got byte 0xff"),
        ("a: 1\n".encode("utf-16"), "expected UTF-8 text"),
        ('a: "\\ud800"\n', "not YAML"),
    ],
)
def test_what_is_refused_says_where_and_why(text, message):
    """Each trick of YAML is one clear error with its line."""
    with pytest.raises(FormatError, match=message):
        parse_yaml(text if isinstance(text, bytes) else text.encode(), HERE)


def test_all_problems_are_told_at_once():
    """Three mistakes, one run, in the order of their lines."""
    lines = refused("a: .nan\nb: 1\nb: 2\nc: 1e999\n").splitlines()

    assert ["some.yaml:1", "some.yaml:3", "some.yaml:4"] == [
        ":".join(line.split(":")[:2]) for line in lines
    ]


def test_a_file_too_large_is_not_read(tmp_path):
    """The cap is on the bytes, before anything is parsed."""
    path = tmp_path / "large.yaml"
    path.touch()
    os.truncate(path, 2**33)

    with pytest.raises(FormatError, match=r"8 MiB"):
        load_yaml(path)


def test_only_regular_files_are_read(tmp_path):
    """A pipe would block for ever, a device never ends."""
    os.mkfifo(tmp_path / "pipe")

    with pytest.raises(FormatError, match="expected a regular file, got a named pipe"):
        load_yaml(tmp_path / "pipe")
    with pytest.raises(FormatError, match="expected a regular file, got a folder"):
        load_yaml(tmp_path)
    with pytest.raises(FormatError, match="expected a regular file, got a device"):
        load_yaml(Path("/dev/zero"))
    with pytest.raises(FormatError, match="cannot be read: No such file"):
        load_yaml(tmp_path / "missing")


def test_numbers_are_finite_whatever_their_length():
    """The longest whole number that is read, and the largest float."""
    assert int("9" * 4000) == resolve("9" * 4000)
    assert math.isfinite(resolve("1.7976931348623157e308"))
