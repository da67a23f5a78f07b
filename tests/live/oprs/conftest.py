"""The module, built once for all tests of a worker."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

import pytest
from build_oprs_module import KERNEL, NoOprsError, build_module, find_oprs

from tests.live.oprs.building import SANITIZED, build_stub, compiler, has_sanitizers
from tests.live.oprs.line_server import Answer, LineServer
from tests.live.oprs.stub_process import StubKernel
from tests.live.oprs.workshop import Oprs, Workshop


@pytest.fixture(scope="session")
def stub_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The stub kernel, with sanitizers where the compiler has them."""
    if compiler() is None:
        pytest.skip("no C compiler here")
    folder = tmp_path_factory.mktemp("oprs_stub")
    return build_stub(folder, *(SANITIZED if has_sanitizers(folder) else ()))


class StartStub(Protocol):
    """Starts a stub kernel; the test's end ends it."""

    def __call__(
        self,
        address: str | None,
        environment: Mapping[str, str] | None = None,
        *,
        timeout_ms: int | None = None,
        stderr: int | None = None,
    ) -> StubKernel: ...


@pytest.fixture
def start_stub(stub_program: Path, tmp_path: Path) -> Iterator[StartStub]:
    """Start stub kernels that ask at an address."""
    with ExitStack() as stack:

        def start(
            address: str | None,
            environment: Mapping[str, str] | None = None,
            *,
            timeout_ms: int | None = None,
            stderr: int | None = None,
        ) -> StubKernel:
            settings = dict(environment or {})
            if timeout_ms:
                settings["SEMMAP_ASK_TIMEOUT_MS"] = str(timeout_ms)
            errors = tmp_path / "stub.err"
            return stack.enter_context(
                StubKernel(
                    [stub_program], errors, address=address, environment=settings, stderr=stderr
                )
            )

        yield start


StartServer = Callable[[Callable[[bytes], Answer]], LineServer]


@pytest.fixture
def start_server(tmp_path: Path) -> Iterator[StartServer]:
    """Start servers on Unix sockets."""
    with ExitStack() as stack:
        count = iter(range(100))
        yield lambda answer: stack.enter_context(
            LineServer(answer, tmp_path / f"doors{next(count)}")
        )


@pytest.fixture(scope="session")
def oprs(tmp_path_factory: pytest.TempPathFactory) -> Oprs:
    """The kernel that SEMMAP_OPRS names."""
    try:
        folder = find_oprs()
    except NoOprsError as error:
        warnings.warn(f"NOT TESTED in a real OpenPRS kernel: {error}", stacklevel=2)
        pytest.skip(str(error))
    return Oprs(folder / KERNEL, build_module(folder, tmp_path_factory.mktemp("module")))


@pytest.fixture
def workshop(oprs: Oprs, tmp_path: Path) -> Iterator[Workshop]:
    """A folder, a kernel's program, and an end to all that was started."""
    with ExitStack() as stack:
        yield Workshop(oprs, tmp_path, stack)
