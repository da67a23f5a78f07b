"""A key revoked: from which of its statements on it is no longer believed about a log.

    semmap-log revocation 1
    log: 0f3c…
    key: ssh-ed25519 AAAA…
    from: 12
    last: 5e01…

It counts by the number of a statement, not by a date: who has stolen a key writes any date. `last`
is the SHA-256 of the newest statement before that number, which binds all that came before it: the
thief can sign other statements of lower numbers, but none in its place.

The signature is that of an owner's key, which is kept offline, in a namespace of its own.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from semmap_log.log.signing.public_keys import key_in_words
from semmap_log.log.signing.ssh_format import KEY_TYPE
from semmap_log.log.signing.statement import NO_DIGEST

TITLE = b"semmap-log revocation "
_FORM = re.compile(
    "semmap-log revocation 1\n"
    "log: ([0-9a-f]{32})\n"
    f"key: ({KEY_TYPE} [A-Za-z0-9+/=]+)\n"
    "from: (0|[1-9][0-9]{0,18})\n"
    "last: ([0-9a-f]{64})\n",
    re.ASCII,
)


@dataclass(frozen=True, slots=True)
class Revocation:
    """That the statements of a key about a log do not count from a number on."""

    log_id: str
    key: str
    """The public key, as a `.pub` has it, without a comment."""
    first: int
    """The number of the first statement that does not count."""
    last: str
    """SHA-256 of the last statement that counts, hexadecimal; zeros: none counts."""

    @property
    def text(self) -> str:
        """Return it as it is signed."""
        return (
            "semmap-log revocation 1\n"
            f"log: {self.log_id}\n"
            f"key: {self.key}\n"
            f"from: {self.first}\n"
            f"last: {self.last}\n"
        )

    @property
    def revokes_all(self) -> bool:
        """Whether no statement of the key counts."""
        return self.last == NO_DIGEST


def read_revocation(data: bytes) -> Revocation:
    """Return the revocation of a text, which has to be exactly as it is written.

    Raises:
        ValueError: It is not.
    """
    found = _FORM.fullmatch(data.decode("ascii", "replace"))
    if found is None:
        raise ValueError("no revocation of version 1 of a key, as it is written")
    log_id, key, first, last = found.groups()
    key_in_words(key)
    return Revocation(log_id, key, int(first), last)
