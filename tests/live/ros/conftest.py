"""The worlds of ROS that tests run in: one of each kind for all tests of a worker."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import pytest

from tests.live.ros.network_namespace import NoNamespaceError
from tests.live.ros.ros_world import NAMES, NotSetUpError, RosWorld, open_world


@pytest.fixture(scope="session")
def ros1() -> Iterator[RosWorld]:
    """ROS 1 with a master."""
    yield from _world("ros1")


@pytest.fixture(scope="session")
def jazzy() -> Iterator[RosWorld]:
    """ROS 2 Jazzy."""
    yield from _world("jazzy")


@pytest.fixture(scope="session")
def kilted() -> Iterator[RosWorld]:
    """ROS 2 Kilted."""
    yield from _world("kilted")


@pytest.fixture(scope="session", params=["ros1", "jazzy", "kilted"])
def every_ros(request: pytest.FixtureRequest) -> RosWorld:
    """Each ROS in turn."""
    world: RosWorld = request.getfixturevalue(request.param)
    return world


@pytest.fixture(scope="session", params=["ros1", "kilted"])
def ros(request: pytest.FixtureRequest) -> RosWorld:
    """ROS 1, and ROS 2 by its last distribution: for what is the same in Jazzy."""
    world: RosWorld = request.getfixturevalue(request.param)
    return world


def _world(leg: str) -> Iterator[RosWorld]:
    try:
        world = open_world(leg)
    except (NotSetUpError, NoNamespaceError) as error:
        warnings.warn(f"NOT TESTED against a real {NAMES[leg]}: {error}", stacklevel=2)
        pytest.skip(str(error))
    yield world
    world.close()
