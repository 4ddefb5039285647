"""A cell of two arms for each test."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator

import pytest

import armada

from .fleet import Agent, Gateway


@pytest.fixture
def gateway() -> Iterator[Gateway]:
    with Gateway() as gateway:
        assert isinstance(gateway, Gateway)
        yield gateway


@pytest.fixture
def left(gateway: Gateway) -> Agent:
    return gateway.add("left_arm")


@pytest.fixture
def right(gateway: Gateway) -> Agent:
    return gateway.add("right_arm")


@pytest.fixture
def cell(gateway: Gateway, left: Agent, right: Agent) -> Iterator[armada.Cell]:
    del left, right  # they are in the cell
    with armada.connect(gateway.endpoint, name="test") as cell:
        yield cell


@pytest.fixture
async def acell(gateway: Gateway, left: Agent, right: Agent) -> AsyncIterator[armada.aio.Cell]:
    del left, right
    async with armada.aio.connect(gateway.endpoint, name="test") as cell:
        yield cell
