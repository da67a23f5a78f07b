"""Every limit and rule by which foreign files and names do no harm."""

from __future__ import annotations

from mutation.mutant import guard

FOREIGN = (
    guard("a size that zstd tells", "_unpack_zstd", "said > most", "False", "test_hostile_bags"),
    guard("what lz4 and bz2 hold", "_unpack_with", "most + 1", "-1", "test_hostile_bags"),
    guard("chunks that overlap", "McapBag._indexed_messages",
          "open_bytes > OPEN_BYTES", "False", "test_hostile_bags"),
    guard("records of a few GiB", "mcap_records.records",
          "length > MOST_BYTES", "False", "test_hostile_bags"),
    guard("lists of nothing", "_Sizes.least_item", "not size", "False", "test_hostile_bags"),
    guard("texts on a stream", "PlainStream.write", "plain(text)", "text", "test_plain_output"),
    guard("texts on a console", "PlainConsole.render",
          "segment.control or segment.text.isprintable()", "True",
          "test_plain_output"),
    guard("brackets that are no markup", "PlainConsole.__init__",
          "markup=False", "markup=True", "test_plain_output"),
    guard("a probability that is no number is none", "_Reader.probability",
          'node.text.lower().lstrip(".") == "nan"', "False", "test_thesis_yaml"),
    guard("a place that is no number", "yaml_values.number_of",
          "math.isnan(value)", "False", "test_thesis_yaml"),
    guard("other files' numbers are finite", "_Builder.scalar",
          "self.takes_nan", "True", "test_strict_yaml"),
    guard("other keys of a door are kept", "_Reader.annotations",
          "found[key] = node.text", "", "test_thesis_yaml"),
    guard("a file without doors is none of the thesis's", "thesis_yaml._Reader.doors",
          "has_doors", "True", "test_thesis_yaml"),
    guard("a door by another name than a number", "thesis_yaml._Reader.doors",
          "not _is_door(node)", "True", "test_thesis_yaml"),
    guard("names that are no formulas", "csv_text.harmless",
          "text = f\"'{text}\"", "", "test_csv_text"),
    guard("names that read like others", "_Reader.new_door",
          "self.has_odd_names |= is_written_otherwise(name)", "",
          "test_csv_text"),
)  # fmt: skip
