"""Watches states and events of all robots at once: run `armada up` first, end with Ctrl-C."""

import asyncio
from contextlib import suppress

import armada


async def watch(robot: armada.aio.Robot) -> None:
    """Prints the state of a robot once a second."""
    async for state in robot.states():
        print(f"{robot.name:12} {state.command_mode:12} {state.joint_position_rad.round(3)}")
        await asyncio.sleep(1.0)


async def tell(robot: armada.aio.Robot) -> None:
    """Prints the events of a robot, also those of before."""
    async for event in robot.events(history=True):
        print(f"{robot.name:12} {event.severity:7} {event.message}")


async def main() -> None:
    """Watches every robot of the cell."""
    async with armada.aio.connect() as cell:
        robots = [cell.robot(name) for name in await cell.robots()]
        await asyncio.gather(*map(watch, robots), *map(tell, robots))


with suppress(KeyboardInterrupt):
    asyncio.run(main())
