"""A time stamp authority: its certificates, made by openssl, and its answers over HTTP."""

from __future__ import annotations

import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")

_CONFIGURATION = """
[ req ]
distinguished_name = name
prompt = no
[ name ]
CN = authority
[ ca ]
basicConstraints = critical,CA:true
subjectKeyIdentifier = hash
[ tsa_certificate ]
basicConstraints = CA:false
extendedKeyUsage = critical,timeStamping
[ tsa ]
default_tsa = one
[ one ]
serial = serial
signer_cert = tsa.pem
signer_key = tsa.key
certs = ca.pem
signer_digest = sha256
default_policy = 1.2.3.4.1
digests = sha256
ess_cert_id_chain = no
ess_cert_id_alg = sha256
"""


def openssl(*arguments: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run openssl in a folder."""
    return subprocess.run(
        ["openssl", *map(str, arguments)], cwd=folder, capture_output=True, text=True, check=False
    )


class Authority:
    """A time stamp authority, with an authority above it; `ca.pem` is what its users need."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.ca = folder / "ca.pem"
        folder.mkdir()
        (folder / "tsa.cnf").write_text(_CONFIGURATION)
        (folder / "serial").write_text("01\n")
        new = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
        config = ("-config", "tsa.cnf")
        self._run("req", "-x509", *config, *new, "-keyout", "ca.key", "-out", "ca.pem",
                  "-extensions", "ca", "-days", "2")  # fmt: skip
        self._run("req", *config, *new, "-keyout", "tsa.key", "-out", "tsa.csr", "-subj", "/CN=tsa")
        self._run("x509", "-req", "-in", "tsa.csr", "-CA", "ca.pem", "-CAkey", "ca.key",
                  "-CAcreateserial", "-extfile", "tsa.cnf", "-extensions", "tsa_certificate",
                  "-out", "tsa.pem", "-days", "2")  # fmt: skip

    def answer(self, query: bytes) -> bytes:
        """Return what it answers to a query."""
        (self._folder / "query").write_bytes(query)
        self._run("ts", "-reply", "-config", "tsa.cnf", "-section", "one", "-queryfile", "query",
                  "-out", "answer")  # fmt: skip
        return (self._folder / "answer").read_bytes()

    def verifies(self, statement: Path, token: Path) -> str:
        """Return what `openssl ts -verify` says of a time stamp."""
        done = openssl("ts", "-verify", "-data", statement, "-in", token, "-CAfile", self.ca,
                       folder=self._folder)  # fmt: skip
        return "OK" if done.returncode == 0 else done.stderr

    def _run(self, *arguments: str) -> None:
        done = openssl(*arguments, folder=self._folder)
        assert done.returncode == 0, done.stderr


@contextmanager
def served(
    answer: Callable[[bytes], bytes], *, status: int = 200, drip_s: float = 0.0
) -> Iterator[tuple[str, list[bytes]]]:
    """Serve answers to queries; hand out the URL, and the queries that came.

    Args:
        answer: What to answer to a query.
        status: With which code.
        drip_s: Waited before each byte.
    """
    asked: list[bytes] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            assert self.headers["Content-Type"] == "application/timestamp-query"
            asked.append(self.rfile.read(int(self.headers["Content-Length"])))
            data = answer(asked[-1])
            self.send_response(status)
            self.send_header("Content-Type", "application/timestamp-reply")
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            for piece in [bytes([each]) for each in data] if drip_s else [data]:
                time.sleep(drip_s)
                self.wfile.write(piece)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/tsa", asked
        finally:
            server.shutdown()
