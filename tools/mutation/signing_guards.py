"""What it rests on that a signed log is what was signed, and that keys stay secret."""

from __future__ import annotations

from mutation.mutant import guard

SIGNING = (
    guard("a signature is that of the key", "ed25519_sdk.is_signed_by",
          "Ed25519PublicKey.from_public_bytes(public_bytes).verify(signature, data)", "",
          "test_ssh_signature"),
    guard("a signature is of this text", "signature_folder.read_signed",
          "not signature.fits(text)", "False", "test_ssh_signature"),
    guard("a signature is for this purpose", "ssh_signature.read_signature",
          "namespace != NAMESPACE.encode()", "False", "test_ssh_signature"),
    guard("a signature's file is as it is written", "ssh_format.unarmoured",
          "armoured(blob) != text", "False", "test_ssh_signature"),
    guard("only given keys are believed", "_Check._is_believed",
          "one.public_bytes not in self._keys", "False", "test_signed_log"),
    guard("a statement is about this log", "_Check._is_believed",
          "one.statement.log_id != self._found.log_id", "False", "test_signed_log"),
    guard("the log reaches as far as was signed", "_Check._is_held",
          "said.next_event > found.next_event", "False", "test_signed_log"),
    guard("the log holds the head that was signed", "_Check._is_held",
          "end is None or end.head.hex() != said.head", "end is None", "test_signed_log"),
    guard("two heads at one event are a fork", "_Check._find_forks",
          "other.statement.head != one.statement.head", "False", "test_signed_log"),
    guard("what is closed is signed", "_Check._find_unsigned",
          "closed > signed", "False", "test_signed_log"),
    guard("nothing is signed that does not verify", "_Signing._refuse_any",
          "one.severity >= Severity.TORN", "False", "test_signed_log"),
    guard("nothing is signed that is not what was signed before", "_Signing._checked",
          "found.ends.get(self._next_event, _NOWHERE).head != self._head", "False",
          "test_signed_log"),
    guard("no live segment is signed", "_Signing._checked",
          "found.events and found.closed_before != found.next_event", "False",
          "test_signing_faults"),
    guard("no log is signed that was rolled back", "_Signing._checked",
          "found.next_event < self._next_event", "False", "test_signed_log"),
    guard("a signature is there before its statement", "signature_folder.write_signed",
          "_write(path.with_name(name + SIGNATURE), signature_of(text, key).encode())\n"
          "_write(path, text)",
          "_write(path, text)\n"
          "_write(path.with_name(name + SIGNATURE), signature_of(text, key).encode())",
          "test_signing_faults"),
    guard("a private key is its owner's alone from the first instant", "private_keys",
          "_PRIVATE_MODE, _PUBLIC_MODE = 0o600, 0o644",
          "_PRIVATE_MODE, _PUBLIC_MODE = 0o644, 0o644", "test_keys"),
    guard("a key replaces nothing", "private_keys._write_new",
          "os.O_WRONLY | os.O_CREAT | os.O_EXCL", "os.O_WRONLY | os.O_CREAT", "test_keys"),
    guard("a key that others can read is refused", "private_keys._private_bytes",
          "status.st_uid == os.getuid() and status.st_mode & _OTHERS", "False", "test_keys"),
    guard("no key lies in a log", "private_keys._refuse_inside",
          "refuse_own_folder(log, path)", "pass", "test_keys"),
)  # fmt: skip
