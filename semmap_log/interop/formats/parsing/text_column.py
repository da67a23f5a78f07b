r"""A column of texts in a buffer of bytes, processed all at once: no text becomes an object.

Texts in our CSV files must be harmless for whoever opens them, and come back as they were. A
spreadsheet takes a cell that begins with = + - or @ for a formula, and a terminal obeys control
characters. So of a text in our CSV files

- one that begins so, or so after blanks and apostrophes, gets an apostrophe before it: `'=1+1`;
- control characters, and those that turn the direction of writing, are written as `\u001b`, and a
  backslash that stands before such a code as `\u005c`;
- blanks at its ends are written as `\u0020`: those around a cell do not count.

Reading reverts exactly these; any other text is taken as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WORD_BYTES = 8
PADDING = bytes(WORD_BYTES)
"""Padding that a buffer needs after its texts, so that whole words can be read from it."""

MOST_PATTERNS = 8
MOST_WORDS = 8
_SLOTS = 4096
_MIX, _SPREAD = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xD6E8FEB86659FD93)
_MASKS = np.array([(1 << 8 * n) - 1 for n in range(WORD_BYTES + 1)], np.uint64)


@dataclass(frozen=True, slots=True)
class TextColumn:
    """Where each text begins and how long it is."""

    buffer: bytes
    """UTF-8, with `PADDING` at its end."""
    starts: NDArray[np.int64]
    lengths: NDArray[np.int64]

    @classmethod
    def of(cls, texts: Sequence[str]) -> TextColumn:
        """Return a column of texts that are objects already."""
        encoded = [text.encode("utf-8", "surrogatepass") for text in texts]
        lengths = np.array([len(text) for text in encoded], np.int64)
        return cls(b"".join(encoded) + PADDING, np.cumsum(lengths) - lengths, lengths)

    def __len__(self) -> int:
        return len(self.starts)

    def stripped(self) -> TextColumn:
        """Return the texts without blanks and tabs at their ends."""
        starts, lengths = self.starts.copy(), self.lengths.copy()
        data = np.frombuffer(self.buffer, np.uint8)
        while (leads := (lengths > 0) & _is_blank(data[starts])).any():
            starts += leads
            lengths -= leads
        while (trails := (lengths > 0) & _is_blank(data[starts + lengths - 1])).any():
            lengths -= trails
        return TextColumn(self.buffer, starts, lengths)

    def bytes_at(self, row: int) -> bytes:
        """Return one text, encoded."""
        start = int(self.starts[row])
        return self.buffer[start : start + int(self.lengths[row])]

    def text_at(self, row: int) -> str:
        """Return one text."""
        return self.bytes_at(row).decode("utf-8", "surrogatepass")

    def patterns(self) -> Iterator[tuple[bytes, NDArray[np.intp], NDArray[np.uint8]]]:
        """Yield the rows that look alike: their pattern, which they are, and their bytes.

        A pattern is a text with each digit made 0. The bytes are one row for each place in the
        text. Of many patterns only some come; the texts that are left are for other ways.
        """
        for length in np.flatnonzero(np.bincount(self.lengths)).tolist():
            rows = np.flatnonzero(self.lengths == length)
            for _ in range(MOST_PATTERNS):
                if not len(rows) or not length:
                    break
                places = self._places(rows, length)
                pattern, alike = _like_first(places)
                if alike.all():
                    yield pattern, rows, places
                    break
                yield pattern, rows[alike], places[:, alike]
                rows = rows[~alike]

    def _places(self, rows: NDArray[np.intp], length: int) -> NDArray[np.uint8]:
        """Return the bytes of texts of one length: place in the text, row."""
        # A view in which a text begins at every byte: taking from it copies whole texts.
        everywhere: NDArray[np.void] = np.ndarray(
            len(self.buffer) - length + 1, f"V{length}", self.buffer, strides=(1,)
        )
        starts = self.starts if len(rows) == len(self.starts) else self.starts[rows]
        taken = everywhere[starts].view(np.uint8).reshape(-1, length)
        return np.ascontiguousarray(taken.T)

    def words(self) -> NDArray[np.uint64] | None:
        """Return the texts as whole words: word, row; None: they are too long for that."""
        longest = int(self.lengths.max(initial=0))
        count = max(1, -(-longest // WORD_BYTES))
        if count > MOST_WORDS:
            return None
        everywhere: NDArray[np.uint64] = np.ndarray(
            len(self.buffer) - WORD_BYTES + 1, "<u8", self.buffer, strides=(1,)
        )
        words = np.empty((count, len(self)), np.uint64)
        last = len(everywhere) - 1
        for i in range(count):
            left = np.clip(self.lengths - i * WORD_BYTES, 0, WORD_BYTES)
            at = np.minimum(self.starts + i * WORD_BYTES, last)
            words[i] = everywhere[at] & _MASKS[left]
        return words


def _is_blank(data: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.isin(data, (ord(" "), ord("\t")))


def _like_first(places: NDArray[np.uint8]) -> tuple[bytes, NDArray[np.bool_]]:
    """Return the pattern of the first text, and which have the same."""
    pattern = bytearray()
    alike = np.ones(places.shape[1], np.bool_)
    for column in places:
        first = int(column[0])
        if ord("0") <= first <= ord("9"):
            pattern.append(ord("0"))
            alike &= (column - np.uint8(ord("0"))) < 10
        else:
            pattern.append(first)
            alike &= column == first
    return bytes(pattern), alike


def number_at(places: NDArray[np.uint8], start: int, end: int) -> NDArray[np.int64]:
    """Return the whole numbers whose digits stand in these places, at most 18 of them."""
    value = np.zeros(places.shape[1], np.int64)
    for column in places[start:end]:
        value *= 10
        value += column - np.uint8(ord("0"))
    return value


def decimals_in(column: TextColumn) -> NDArray[np.float64]:
    """Return what `float` gives for each text; NaN for those that are no plain decimal numbers."""
    values = np.full(len(column), np.nan)
    for pattern, rows, places in column.patterns():
        whole, _, fraction = pattern.partition(b".")
        digits = len(whole) + len(fraction)
        if not digits or (whole + fraction).strip(b"0"):
            continue
        if digits <= EXACT_DIGITS:  # both exact, so that the quotient is the nearest double
            point = len(whole)
            mantissa = number_at(
                np.delete(places, point, axis=0) if fraction else places, 0, digits
            )
            values[rows] = mantissa / 10.0 ** len(fraction)
        else:
            texts = np.ascontiguousarray(places.T).view(f"S{len(places)}").ravel()
            values[rows] = texts.astype(np.float64)
    return values


EXACT_DIGITS = 15
"""Whole numbers of so many digits, and powers of ten up to 22, are exact as doubles."""


class TextCodes:
    """Gives each different text a number, in the order in which they first come."""

    def __init__(self) -> None:
        self.texts: list[bytes] = []
        self._code_of: dict[bytes, int] = {}
        self._keys = np.zeros(_SLOTS, np.uint64)
        self._codes = np.full(_SLOTS, -1, np.int64)
        """By the highest bits of a key: the last text that had them."""
        self._known: NDArray[np.uint64] = np.zeros((MOST_WORDS, 16), np.uint64)
        """The words of each text; zeros after its end."""
        self._lengths = np.zeros(16, np.int64)

    def __len__(self) -> int:
        return len(self.texts)

    def code_of(self, text: bytes) -> int | None:
        """Return the number of a text; None: it has none yet."""
        return self._code_of.get(text)

    def add(self, text: bytes) -> int:
        """Give a text the next number."""
        code = self._code_of[text] = len(self.texts)
        self.texts.append(text)
        if code == len(self._lengths):
            self._known = np.concatenate([self._known, np.zeros_like(self._known)], axis=1)
            self._lengths = np.concatenate([self._lengths, np.zeros_like(self._lengths)])
        padded = text[: WORD_BYTES * MOST_WORDS].ljust(WORD_BYTES * MOST_WORDS, b"\0")
        self._known[:, code] = np.frombuffer(padded, "<u8")
        self._lengths[code] = len(text)
        return code

    def codes_of(
        self, column: TextColumn, accepts: Callable[[bytes], bool]
    ) -> NDArray[np.int64] | None:
        """Return the number of each text, after new ones were given theirs.

        None where the column wants another way: texts that are long, or new ones that `accepts`
        does not; then none is given a number.
        """
        words = column.words()
        if words is None:
            return None
        keys = column.lengths.astype(np.uint64) * _SPREAD
        for word in words:
            keys = (keys ^ word) * _MIX
            keys ^= keys >> np.uint64(29)
        slots = (keys >> np.uint64(52)).astype(np.intp)
        codes = self._codes[slots]
        codes[self._keys[slots] != keys] = -1
        missing = np.flatnonzero(codes < 0)
        if len(missing):
            found = self._look_up(column, keys, missing, accepts)
            if found is None:
                return None
            codes[missing] = found
        # Other texts may have the same key: nothing is believed that was not compared.
        same = self._lengths[codes] == column.lengths
        for i, word in enumerate(words):
            same &= self._known[i][codes] == word
        return codes if same.all() else None

    def _look_up(
        self,
        column: TextColumn,
        keys: NDArray[np.uint64],
        rows: NDArray[np.intp],
        accepts: Callable[[bytes], bool],
    ) -> NDArray[np.int64] | None:
        """Return the numbers of texts that are not in their slot: new ones, and rivals for it."""
        different, first, which = np.unique(keys[rows], return_index=True, return_inverse=True)
        texts = [column.bytes_at(row) for row in rows[first].tolist()]
        if not all(text in self._code_of or accepts(text) for text in texts):
            return None
        for i in np.argsort(first).tolist():
            if texts[i] not in self._code_of:
                self.add(texts[i])
        codes = np.array([self._code_of[text] for text in texts], np.int64)
        slots = (different >> np.uint64(52)).astype(np.intp)
        self._keys[slots], self._codes[slots] = different, codes
        found: NDArray[np.int64] = codes[which]
        return found


_FORMULA = re.compile(r"['\s]*[=+\-@\uff1d\uff0b\uff0d\uff20]")
"""Wide ones count in Excel, too."""
_STEERING = "\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
_CODE = (
    r"u(?:00[01][0-9a-f]|0020|007f|00[89][0-9a-f]|00a0|005c|061c|1680|200[0-9aef]|202[89a-f]|205f"
    r"|206[6-9]|3000)"
)
_TO_WRITE = re.compile(rf"[{_STEERING}]|\\(?={_CODE})|\A\s+|\s+\Z")
_TO_READ = re.compile(rf"\\(?={_CODE})u(....)")


def harmless(text: str) -> str:
    """Return how a text is written."""
    if _FORMULA.match(text):
        text = f"'{text}"
    return _TO_WRITE.sub(lambda found: "".join(f"\\u{ord(c):04x}" for c in found[0]), text)


def is_written_otherwise(text: str) -> bool:
    """Return whether a text stands for another one when it is read."""
    return text.startswith("'") or "\\u" in text


def meant(text: str) -> str:
    """Return the text that was written so; blanks around it do not count."""
    text = text.strip()
    if not is_written_otherwise(text):
        return text
    text = _TO_READ.sub(lambda found: chr(int(found[1], 16)), text)
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text
