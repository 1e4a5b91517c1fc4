"""Flies a served PX4 with MAVSDK, unmodified: take-off, offboard velocities in both frames, a go-to, landing. Prints what it saw."""

import asyncio
import json
import math
import sys

from mavsdk.asyncio.mavsdk import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.component_type import ComponentType
from mavsdk.plugins.offboard import VelocityBodyYawspeed, VelocityNedYaw

SEEN = {}


async def first(stream, wanted):
    async for value in stream:
        if wanted(value):
            return value


async def main():
    settings = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(settings) as client:
        await client.add_any_connection(sys.argv[1])
        system = await client.first_autopilot(timeout_s=10)
        telemetry, action, offboard = TelemetryAsync(system), ActionAsync(system), OffboardAsync(system)
        healthy = await first(
            telemetry.subscribe_health(), lambda it: it.is_global_position_ok and it.is_home_position_ok and it.is_armable
        )
        SEEN["healthy"] = bool(healthy)
        home = await first(telemetry.subscribe_position(), lambda it: True)
        await action.set_takeoff_altitude(4.0)
        await action.arm()
        await action.takeoff()
        await first(telemetry.subscribe_landed_state(), lambda it: int(it) == 2)
        await first(telemetry.subscribe_flight_mode(), lambda it: int(it) == 3)  # HOLD
        top = await first(telemetry.subscribe_position(), lambda it: True)
        SEEN["height_m"] = top.relative_altitude_m
        # 2 m/s forward and turning in its own frame, then 2 m/s to the west.
        await offboard.set_velocity_body(VelocityBodyYawspeed(2.0, 0.0, 0.0, 20.0))
        await offboard.start()
        await asyncio.sleep(3)
        fast = await first(telemetry.subscribe_velocity_ned(), lambda it: True)
        SEEN["body_speed_m_s"] = math.hypot(fast.north_m_s, fast.east_m_s)
        await offboard.set_velocity_ned(VelocityNedYaw(0.0, -2.0, 0.0, 0.0))
        await asyncio.sleep(3)
        west = await first(telemetry.subscribe_velocity_ned(), lambda it: True)
        SEEN["west_m_s"], SEEN["north_m_s"] = -west.east_m_s, west.north_m_s
        await offboard.stop()
        here = await first(telemetry.subscribe_position(), lambda it: True)
        SEEN["away_m"] = metres(home, here)
        await action.goto_location(home.latitude_deg, home.longitude_deg, home.absolute_altitude_m + 4.0, 0.0)
        await first(telemetry.subscribe_position(), lambda it: metres(home, it) < 1.5)
        SEEN["returned"] = True
        await action.land()
        await first(telemetry.subscribe_armed(), lambda armed: not armed)
        SEEN["disarmed"] = True


def metres(one, other):
    north = (other.latitude_deg - one.latitude_deg) * 111_194.9
    east = (other.longitude_deg - one.longitude_deg) * 111_194.9 * math.cos(math.radians(one.latitude_deg))
    return math.hypot(north, east)


asyncio.run(asyncio.wait_for(main(), 90))
print(json.dumps(SEEN))
