"""What `serve --oprs` takes, and the service of OPRS kernels that it runs beside the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from semmap_log.cli.common import say

if TYPE_CHECKING:
    from semmap_log.live.planners.actions import AskedDoors
    from semmap_log.live.planners.kernels.kernel_service import Kernels, KernelService
    from semmap_log.live.planners.oracle import Oracle

PORT = 3300
"""Of a message passer that was not told another."""
NAME = "SEMMAP"

OprsAt = Annotated[
    str | None,
    typer.Option(
        "--oprs",
        metavar="HOST[:PORT]",
        help="Serve OPRS kernels by their message passer (mp-oprs); needs no ROS.",
    ),
]
OprsName = Annotated[
    str | None,
    typer.Option("--oprs-name", metavar="NAME", help=f"Ours, to which kernels send; {NAME}."),
]
OprsTo = Annotated[
    list[str] | None,
    typer.Option(
        "--oprs-to", metavar="KERNEL", help="Post it a fact at each change; give it once for each."
    ),
]


def chosen_kernels(
    address: str | None, name: str | None, told: Sequence[str] | None
) -> Kernels | None:
    """Return which kernels are to be served; None: none.

    Raises:
        typer.BadParameter: They cannot be.
    """
    from semmap_log.errors import AddressError, PasserError
    from semmap_log.live.planners.addresses import TcpAddress, read_address
    from semmap_log.live.planners.kernels.kernel_service import Kernels

    if address is None:
        for option, given in {"--oprs-name": name, "--oprs-to": told}.items():
            if given:
                raise typer.BadParameter("only with --oprs", param_hint=option)
        return None
    try:
        where = read_address(f"tcp:{address if _has_port(address) else f'{address}:{PORT}'}")
        assert isinstance(where, TcpAddress)
    except AddressError:
        raise typer.BadParameter(
            f"expected a host and a port such as 127.0.0.1:{PORT}, got {address!r}",
            param_hint="--oprs",
        ) from None
    try:
        return Kernels(where, name or NAME, tuple(dict.fromkeys(told or ())))
    except PasserError as error:
        raise typer.BadParameter(str(error), param_hint="--oprs-name, --oprs-to") from error


def _has_port(address: str) -> bool:
    return ":" in address.rpartition("]")[2]


@contextmanager
def kernels_served(
    kernels: Kernels, oracle: Oracle, doors: AskedDoors, changes: list[Callable[[], object]]
) -> Iterator[KernelService]:
    """Tell kernels of the doors, and answer them, within.

    Args:
        kernels: Who, and where.
        oracle: Knows the answers.
        doors: What they are told of.
        changes: Called after each change of the doors.
    """
    from semmap_log.live.planners.kernels.kernel_service import KernelService

    service = KernelService(oracle, doors, kernels, say=say)
    changes.append(service.wake)
    try:
        yield service
    finally:
        service.close()
