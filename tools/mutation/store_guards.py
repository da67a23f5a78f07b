"""Logs in a store: what is believed of it, and what is compared."""

from __future__ import annotations

from mutation.mutant import Mutant, guard

STORES: tuple[Mutant, ...] = (
    guard(
        "stores: bytes that lie there are compared",
        "_Shipping._holds",
        "digest.hexdigest() == sha256",
        "True",
        "test_seam",
    ),
    guard(
        "stores: one that ignores If-Match is refused",
        "check_conditions",
        """store.replace(name, b"3", '"0123456789abcdef0123456789abcdef"')""",
        "False",
        "test_seam",
    ),
    guard(
        "stores: one that ignores If-None-Match is refused",
        "check_conditions",
        'store.create(name, b"2")',
        "False",
        "test_shipping",
    ),
    guard(
        "stores: a forked process is told",
        "check_not_forked",
        "_asked_in[0] != os.getpid()",
        "False",
        "test_seam",
    ),
    guard(
        "stores: no password in a message",
        "object_store._said",
        're.sub(r"://[^/\\s]*@", "://", " ".join(words))',
        '" ".join(words)',
        "test_seam",
    ),
    guard(
        "stores: a manifest's numbers are numbers",
        "manifest._number",
        "type(found) is not int or not 0 <= found < 2**63",
        "False",
        "test_seam",
    ),
    guard(
        "stores: a manifest tells what can be", "_check_possible", "not holds", "False", "test_seam"
    ),
    guard(
        "stores: verify compares each field",
        "manifest_differences._differences",
        "said != is_so",
        "False",
        "test_seam",
    ),
    guard(
        "stores: verify compares the SHA-256",
        "ObjectPlace._with_sha256",
        "replace(one, sha256=self._files.sha256(self._listed[one.name]))",
        "replace(one, sha256=self._manifest.manifest.segments[0].sha256)",
        "test_seam",
    ),
    guard(
        "stores: the next segments are on their way",
        "SegmentsAhead.at",
        "self._ask(segment)",
        "pass",
        "test_segments_ahead",
    ),
    guard(
        "stores: an object that is too long is not read",
        "ObjectStore.whole",
        "status.size > most_bytes",
        "False",
        "test_endless_answers",
    ),
    guard(
        "stores: no more is read than was asked for",
        "ObjectStore._body",
        "come > size",
        "False",
        "test_endless_answers",
    ),
    guard(
        "stores: no piece that is too long",
        "ObjectSource._check_piece",
        "length > MOST_READ_BYTES",
        "False",
        "test_endless_answers",
    ),
    guard(
        "stores: an answer that fills the memory",
        "bounded_requests.answer_of",
        "_peak_bytes() > most",
        "False",
        "test_endless_answers",
    ),
    guard(
        "stores: room on the disk",
        "fetching._check_room",
        "size > free",
        "False",
        "test_endless_answers",
    ),
    guard(
        "fleet: a worker that comes back late",
        "DaskEngine.__init__",
        '"distributed.deploy.lost-worker-timeout"',
        '"distributed.deploy.nothing"',
        "test_a_worker_that_comes_back_late_is_waited_for",
    ),
)
