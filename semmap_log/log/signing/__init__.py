"""Signatures of a log's heads: who vouches that its events are those that were recorded.

The hash of a commit stands for all events before it, and a digest for what was taken out of the
log. So a few lines of text with both, signed with a key that lies elsewhere, show whether the log
was changed since: `statement`.

The signatures are those of OpenSSH (PROTOCOL.sshsig): `ssh-keygen` makes the keys and checks the
signatures without this program.

ed25519_sdk       the one file that imports `cryptography`
statement         what is signed; OpenSSH's formats: signatures and public keys
signature_folder  where both lie, LOG/signatures; time stamps and revocations
timestamp_token   a time stamp of RFC 3161: its query, and what it says
signer_state      what a key has signed last, KEY.state; signs statement after statement
log_signing       signs a log at rest; private keys, read or made
background_signer       signs a log while it is written
signed_log        verifies a log against its signatures; whom to believe
"""
