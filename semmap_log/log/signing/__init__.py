"""Signatures of a log's heads: who vouches that its events are those that were recorded.

The hash of a commit stands for all events before it, and a digest for what was taken out of the
log. So a few lines of text with both, signed with a key that lies elsewhere, show whether the log
was changed since: `statement`.

The signatures are those of OpenSSH (PROTOCOL.sshsig): `ssh-keygen` makes the keys and checks the
signatures without this program.

ed25519_sdk       the one file that imports `cryptography`
ssh_format        OpenSSH's strings and armour
ssh_signature     a signature: made, read, checked
public_keys       whom to believe: `.pub` files and allowed_signers
private_keys      who signs: a key read, or made
statement         what is signed
revocation        what revokes a key
signature_folder  where both lie: LOG/signatures
timestamp_token   a time stamp of RFC 3161: its query, and what it says
timestamps        time stamps of statements, from an authority
signer_state      what a key has signed last: KEY.state
signer            statement after statement, each after the last
log_signing       a log at rest, signed
sign_beside       a log signed while somebody writes it
trust             whom to believe: with successors and revocations
signed_log        a log verified against its signatures
"""
