"""tello-asyncio, unmodified and written apart from djitellopy: connect, take off, turn, move, go, land."""

import asyncio
import json

from tello_asyncio import Tello, Vector


async def main():
    drone = Tello()
    await drone.connect()
    battery = await drone.query_battery()
    states = []
    reader = asyncio.create_task(read(drone, states))
    await drone.takeoff()
    height = drone.height
    await drone.turn_clockwise(45)
    await drone.move_up(30)
    # Not `rc`: this client waits for an answer to it, which no Tello gives.
    await drone.go_to(relative_position=Vector(30, 0, 0), speed=40)
    await drone.move_back(30)
    await drone.land()
    reader.cancel()
    await drone.disconnect()
    print(json.dumps({"battery": battery, "height": height, "states": len(states)}))


async def read(drone, states):
    async for state in drone.state_stream:
        states.append(state)


asyncio.run(asyncio.wait_for(main(), 90))
