"""The cabinet agent end to end: devices behind real lines, a real server; and what it remembers."""

from __future__ import annotations

import asyncio
import json
import time

import pytest
from cabinet_rig import MILK, MUG, Shelf, agent, until

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.loadboard.emulator import RosTmsBoardDevice
from tms_agents.devices.tr3.emulator import Tr3Device


async def test_things_come_and_go_in_room_coordinates(rig):
    shelf, reader = Shelf(), Tr3Device()
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board, PtyLine(reader) as line:
        source = f'{{kind = "tr3-serial", device = "{line.path}", poll_s = 0.1}}\nweigh_s = 0.3'
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}', reader=source)
        town = cabinet.town
        for tag, name in ((MILK, "Milk"), (MUG, "Mug")):
            cabinet.register(tag, name)
        async with cabinet.agent():
            await cabinet.ready("shelf", "reader")
            reader.see(MILK)
            shelf.put("milk", 500, 0.1, 0.2)
            (milk,) = (await cabinet.count(1)).values()
            # The board lies at (2, 1) and is turned by 90 degrees: (x, y) on it is (2 - y, 1 + x) in the room.
            assert milk.xy == pytest.approx((1.8, 1.1), abs=0.01)
            assert (milk.z, milk.furniture, milk.kind) == (0.8, "cabinet", "cabinet") or milk.surface == "cabinet/shelf"
            await until(lambda: town.where("Milk").best is not None and town.where("Milk").best.label == milk.label)

            reader.see(MUG)
            shelf.put("mug", 300, 0.4, 0.1)
            await cabinet.count(2)
            reader.lose(MILK)
            shelf.take("milk")
            (mug,) = (await cabinet.count(1)).values()
            assert mug.label != milk.label
            await until(lambda: town.where("Mug").best is not None and town.where("Mug").best.label == mug.label)
            assert any(frame.data[:2] == b"\x9e\x00" for frame in reader.heard)  # weighed with the field off
        assert (await cabinet.view()).state == "silent"
    assert town.anomalies(cabinet.name).anomalies == []


async def test_a_restart_keeps_stays_and_labels(rig):
    """As a process, killed; while it is away one thing is taken and another put."""
    shelf, reader = Shelf(), Tr3Device()
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board, PtyLine(reader) as line:
        source = f'{{kind = "tr3-serial", device = "{line.path}", poll_s = 0.1}}'
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}', reader=source)
        async with agent(cabinet.config) as process:
            await cabinet.ready("shelf")
            shelf.put("milk", 500, 0.1, 0.2)
            first = set(await cabinet.count(1))
            shelf.put("mug", 300, 0.4, 0.1)
            both = set(await cabinet.count(2))
            state = cabinet.config.with_name("cabinet.spool.state.json")
            await until(lambda: len(json.loads(state.read_bytes())["boards"]["shelf"]["labels"]) == 2)
            process.kill()
        async with agent(cabinet.config) as process:
            await cabinet.state("connected", "shelf")
            assert set(await cabinet.labels()) == both
            process.kill()
        shelf.take("mug")
        async with agent(cabinet.config):
            assert set(await cabinet.count(1)) == first
        log = cabinet.config.with_suffix(".log").read_text()
        assert "Traceback" not in log and "does not fit" not in log
    assert cabinet.town.anomalies(cabinet.name).anomalies == []


async def test_a_state_that_cannot_be_used_is_put_aside(rig, caplog):
    shelf = Shelf()
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board:
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}')
        state = cabinet.config.with_name("cabinet.spool.state.json")
        state.write_text('{"format": 1, "agent"')
        async with cabinet.agent():
            await cabinet.ready("shelf")
            shelf.put("milk", 500, 0.1, 0.2)
            await cabinet.count(1)
    assert "cannot be used" in caplog.text and state.with_name(f"{state.name}.broken").exists()
    assert len(json.loads(state.read_bytes())["boards"]["shelf"]["labels"]) == 1


async def test_a_clock_that_is_set_back_breaks_nothing(rig):
    shelf, wrong = Shelf(), [0.0]
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board:
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}')
        async with cabinet.agent(clock=lambda: time.time() + wrong[0]):
            await cabinet.ready("shelf")
            shelf.put("milk", 500, 0.1, 0.2)
            await cabinet.count(1)
            wrong[0] = -3600.0
            shelf.take("milk")
            await cabinet.count(0)
            wrong[0] = 7200.0
            shelf.put("mug", 300, 0.1, 0.2)
            await cabinet.count(1)
    assert cabinet.town.anomalies(cabinet.name).anomalies == []


async def test_known_weights_come_from_the_objects_and_stay_for_when_the_server_is_away(rig):
    shelf = Shelf()
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board:
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}')
        cabinet.register(MILK, "Milk", weight_g=512.0)
        copy = cabinet.config.with_name("cabinet.spool.weights.json")
        async with cabinet.agent():
            await until(copy.exists)
        mean, sd = json.loads(copy.read_bytes())[MILK]
        assert (mean, sd > 0) == (512.0, True)


async def test_two_agents_with_one_spool_are_refused(rig):
    shelf = Shelf()
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board:
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}')
        async with cabinet.agent():
            await cabinet.state("connected", "shelf")
            async with agent(cabinet.config) as second:
                assert await asyncio.to_thread(second.wait, 20) == 2
            assert "spool" in cabinet.config.with_suffix(".log").read_text()
