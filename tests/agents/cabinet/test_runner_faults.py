"""Every fault of a cabinet's devices: the server shows it within 5 s, it heals by itself, and nothing is made up."""

from __future__ import annotations

import asyncio

from cabinet_rig import MILK, Shelf

from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.loadboard.emulator import RosTmsBoardDevice
from tms_agents.devices.scales.emulator import AndScale
from tms_agents.devices.tr3.emulator import Tr3Device

SOON_S = 5.0


def only(labels):
    """The one label there is."""
    (label,) = labels.values()
    return label


async def test_faults_of_a_board(rig):
    shelf = Shelf()
    device = RosTmsBoardDevice(shelf.counts)
    async with PtyLine(device, tick_s=0.005) as line:
        cabinet = rig(f'{{kind = "ros-tms", device = "{line.path}"}}')
        async with cabinet.agent():
            await cabinet.ready("shelf")
            shelf.put("milk", 500, 0.1, 0.2)
            before = only(await cabinet.count(1))

            device.silent = True
            assert line.path in (await cabinet.state("silent", "shelf: board", SOON_S)).why
            device.silent = False
            await cabinet.state("connected")

            line.hang_up()
            await cabinet.state("faulty", "shelf: board", SOON_S)
            line.plug_in()
            await cabinet.state("connected")

            device.deaf.add(2)
            await cabinet.state("faulty", "shelf: no answer from cell 2", SOON_S)
            device.deaf.clear()
            await cabinet.state("connected")

            device.stuck[1] = 777
            await cabinet.state("faulty", "shelf: cell 1 does not measure", SOON_S)
            device.stuck.clear()
            await cabinet.state("connected")

            device.cut_next = 1  # switched off in the middle of an answer, and on again with other zeros
            device.garble_next = 1
            device.power_cycle()
            device.silent = True
            await cabinet.state("silent", "shelf", SOON_S)
            shelf.zero_g += [8, -6, 4, 9]
            device.silent = False
            await cabinet.state("connected")

            shelf.put("mug", 300, 0.4, 0.1)
            labels = await cabinet.count(2)
    assert labels.pop(before.label).since == before.since
    # Labels are counted: a thing that came and went in between would have taken the number.
    assert int(only(labels).label.rpartition("/")[2]) == int(before.label.rpartition("/")[2]) + 1
    assert cabinet.town.anomalies(cabinet.name).anomalies == []


async def test_faults_of_a_reader(rig):
    shelf, reader = Shelf(), Tr3Device()
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board, PtyLine(reader) as line:
        source = f'{{kind = "tr3-serial", device = "{line.path}", poll_s = 0.1}}'
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}', reader=source)
        cabinet.register(MILK, "Milk")
        async with cabinet.agent():
            await cabinet.ready("shelf", "reader")
            shelf.put("milk", 500, 0.1, 0.2)
            reader.see(MILK)
            before = only(await cabinet.count(1))

            reader.silent = True
            await cabinet.state("silent", f"reader: TR3 {line.path}", SOON_S)
            reader.silent = False
            await cabinet.state("connected")

            reader.nack_next = 1_000_000  # until told otherwise: a short fault is not always seen
            await cabinet.state("faulty", "refuses", SOON_S)
            reader.nack_next = 0
            await cabinet.state("connected")

            line.hang_up()
            await cabinet.state("faulty", "reader: TR3", SOON_S)
            board.hang_up()  # both: each is named
            await cabinet.state("faulty", "shelf: board", SOON_S)
            line.plug_in()
            board.plug_in()
            await cabinet.state("connected")
            found = only(await cabinet.count(1))
    assert (found.label, found.since) == (before.label, before.since)
    assert cabinet.town.anomalies(cabinet.name).anomalies == []
    assert cabinet.town.where("Milk").best.label == before.label


async def test_faults_of_a_scale(rig):
    """One scale under the whole shelf: overload, and a scale that zeroes itself when it is switched on."""
    shelf = Shelf()
    scale = AndScale(shelf.total, capacity_g=2000, period_s=0.02, boot_s=0.1)
    async with TcpLine(scale) as line:
        load = f'{{kind = "and", host = "127.0.0.1", port = {line.port}, poll_s = 0.05}}'
        cabinet = rig(load, cells=False)
        async with cabinet.agent():
            await cabinet.ready("shelf")
            shelf.put("milk", 500, 0.1, 0.2)
            before = only(await cabinet.count(1))

            shelf.put("arm", 5000, 0.2, 0.2)
            await cabinet.state("faulty", "shelf: overload", SOON_S)
            shelf.take("arm")
            await cabinet.state("connected")

            scale.silent = True
            await cabinet.state("silent", "shelf: scale", SOON_S)
            scale.power_cycle()
            scale._take_tare()  # with the milk on it, as scales do
            scale.silent = False
            await cabinet.state("connected")
            await asyncio.sleep(0.5)  # nobody is faster than that at the cabinet

            shelf.put("mug", 300, 0.4, 0.1)
            labels = await cabinet.count(2)
            shelf.take("milk")
            labels = await cabinet.count(1)
    assert int(only(labels).label.rpartition("/")[2]) == int(before.label.rpartition("/")[2]) + 1
    assert cabinet.town.anomalies(cabinet.name).anomalies == []
