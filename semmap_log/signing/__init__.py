"""Signatures of a log's heads: who vouches that its events are those that were recorded.

The hash of a commit stands for all events before it. So a few lines of text with that hash, signed
with a key that lies elsewhere, show whether the log was changed since: `head_statement`.

The signatures are those of OpenSSH (PROTOCOL.sshsig): `ssh-keygen` makes the keys and checks the
signatures without this program.

ed25519_sdk       the one file that imports `cryptography`
ssh_format        OpenSSH's strings and armour
ssh_signature     a signature: made, read, checked
public_keys       whom to believe: `.pub` files and allowed_signers
private_keys      who signs: a key read, or made
head_statement    what is signed
signature_folder  where it lies: LOG/signatures
log_signing       a log signed
sign_beside       the same while somebody writes it
signed_log        a log verified against its signatures
"""
