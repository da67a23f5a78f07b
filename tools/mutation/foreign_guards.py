"""Every limit and rule by which foreign files and names do no harm."""

from __future__ import annotations

from mutation.mutant import mutants_in

HOSTILE = "tests/formats/test_hostile_bags.py"
PLAIN = "tests/cli/test_plain_output.py"
THESIS = "tests/formats/test_thesis_yaml.py"
STRICT = "tests/formats/test_strict_yaml.py"
CSV_TEXT = "tests/formats/test_csv_text.py"


_put = mutants_in("semmap_log/")


FOREIGN = (
    _put("a size that zstd tells", "formats/unpacking.py", "if said > most:", "if False:", HOSTILE),
    _put("what lz4 and bz2 hold", "formats/unpacking.py", "max_length=most + 1", "max_length=-1",
         HOSTILE),
    _put("chunks that overlap", "formats/mcap_reading.py", "if open_bytes > OPEN_BYTES:",
         "if False:", HOSTILE),
    _put("records of a few GiB", "formats/mcap_records.py", "if length > MOST_BYTES:", "if False:",
         HOSTILE),
    _put("lists of nothing", "formats/ros_sizes.py", "if not size:", "if False:", HOSTILE),
    _put("texts on a stream", "cli/plain_streams.py", "self.beneath.write(plain(text))",
         "self.beneath.write(text)", PLAIN),
    _put("texts on a console", "cli/plain_console.py",
         "if segment.control or segment.text.isprintable():", "if True:", PLAIN),
    _put("brackets that are no markup", "cli/plain_console.py", "markup=False", "markup=True",
         PLAIN),
    _put("a probability that is no number is none", "formats/thesis_yaml.py",
         'node.text.lower().lstrip(".") == "nan"', "False", THESIS),
    _put("a place that is no number", "formats/yaml_values.py", "if math.isnan(value):",
         "if False:", THESIS),
    _put("other files' numbers are finite", "formats/strict_yaml.py",
         "plain and self.takes_nan and", "plain and", STRICT),
    _put("other keys of a door are kept", "formats/thesis_yaml.py",
         "                found[key] = node.text\n", "", THESIS),
    _put("a file without doors is none of the thesis's", "formats/thesis_yaml.py",
         "if has_doors and not _is_door(node):", "if not _is_door(node):", THESIS),
    _put("a door by another name than a number", "formats/thesis_yaml.py",
         "if has_doors and not _is_door(node):", "if has_doors:", THESIS),
    _put("names that are no formulas", "formats/csv_text.py",
         "        text = f\"'{text}\"\n", "        pass\n", CSV_TEXT),
    _put("names that read like others", "formats/door_csv.py",
         "self.has_odd_names |= is_written_otherwise(name)", "pass", CSV_TEXT),
)  # fmt: skip
