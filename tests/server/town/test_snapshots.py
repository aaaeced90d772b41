"""Snapshots save time at a start and never change what is believed, whatever became of them."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from typing import Any

import pytest
from sqlalchemy import select, text, update

from tms_server.db.tables import SnapshotRow
from tms_server.log.snapshots import thinned_out
from tms_server.town.fold import RoomFold


def course(at: Any, first: int, last: int) -> Iterator[dict[str, Any]]:
    """A person walks, and things come and go, one observation a second."""
    for seq in range(first, last):
        event: dict[str, Any] = {"type": "label_moved", "label": "floor/0", "xy": [seq % 8, 1]}
        if seq == 0:
            event = {"type": "mover_entered", "label": "floor/0", "xy": [0, 1]}
        elif seq % 5 == 1:
            tag = f"E{seq % 3}"
            event = {"type": "label_appeared", "label": f"floor/{seq}", "kind": "floor", "xy": [seq % 8, 1], "tag": tag}
        elif seq % 5 == 3:
            event = {"type": "label_vanished", "label": f"floor/{seq - 2}"}
        yield {"seq": seq, "observed_at": at(seq), **event}


async def tell(lab: Any, at: Any, first: int, last: int) -> None:
    for event in course(at, first, last):
        await lab.post("floor", event)


@pytest.fixture
async def told(open_lab, at) -> bytes:
    """Forty observations, a snapshot every five, and the belief after them."""
    async with open_lab(snapshot_every=5) as lab:
        await lab.room(tags=["E0", "E1", "E2"])
        for first in range(0, 40, 5):
            await tell(lab, at, first, first + 5)
            view = await lab.belief()  # folded before more comes, however slow the machine
        return view.fold.to_bytes()


async def test_a_restart_is_bit_identical(open_lab, told: bytes) -> None:
    async with open_lab() as lab:
        assert (await lab.belief()).fold.to_bytes() == told
        assert (await lab.sequential()).to_bytes() == told


@pytest.mark.parametrize(
    "damage",
    [
        lambda body: b"",
        lambda body: body[: len(body) // 2],
        lambda body: body[:-1],
        lambda body: body[:20] + bytes([body[20] ^ 1]) + body[21:],
        lambda body: body[:-5] + bytes([body[-5] ^ 255]) + body[-4:],
        lambda body: b"TMS room 0\n" + body[11:],
    ],
    ids=["empty", "half", "one byte short", "checksum", "content", "version"],
)
@pytest.mark.parametrize("all_of_them", [False, True])
async def test_a_damaged_one_is_left_out(open_lab, told: bytes, damage: Any, all_of_them: bool) -> None:
    async with open_lab() as lab, lab.sessions.write() as session:
        rows = list(await session.scalars(select(SnapshotRow).order_by(SnapshotRow.offset.desc())))
        assert len(rows) > 3
        for row in rows if all_of_them else rows[:1]:
            row.body = damage(row.body)
        await session.commit()
    async with open_lab() as lab:
        assert (await lab.belief()).fold.to_bytes() == told


def test_torn_anywhere_it_is_refused() -> None:
    whole = RoomFold(10).to_bytes()
    assert RoomFold.from_bytes(whole).to_bytes() == whole
    for cut in range(len(whole)):
        with pytest.raises(ValueError):
            RoomFold.from_bytes(whole[:cut])


@pytest.mark.parametrize("later_s", [0.0, 0.02, 0.1])
async def test_closed_in_the_middle_of_a_batch_it_is_of_the_whole_batch(open_lab, at, later_s: float) -> None:
    async with open_lab() as lab:
        await lab.room(tags=["E0", "E1", "E2"])
        await lab.belief()
        await tell(lab, at, 0, 5)  # since then nobody has asked: the state of that moment is not copied yet
        await asyncio.sleep(0.2)
        await lab.post("floor", *course(at, 5, 600))
        await asyncio.sleep(later_s)
    async with open_lab() as lab:
        async with lab.sessions.read() as session:
            stored = {row.offset: row.body for row in await session.scalars(select(SnapshotRow))}
        assert stored
        for offset, body in stored.items():
            assert body == (await lab.sequential(until=offset)).to_bytes()


async def test_one_of_another_budget_is_left_out(open_lab, told: bytes) -> None:
    async with open_lab(budget=17) as lab:
        assert (await lab.belief()).fold.engine.budget == 17


async def test_what_came_after_it_and_belongs_before_it_is_not_lost(open_lab, at, told: bytes) -> None:
    """The late record is in the log, but no snapshot knows it: as after a crash between commit and fold."""
    async with open_lab(holdback_s=3600 * 24 * 365 * 100) as lab:
        await lab.post(
            "cab", {"seq": 0, "observed_at": at(7.5), "type": "mover_entered", "label": "cab/0", "xy": [1, 1]}
        )
    async with open_lab() as lab:
        view = await lab.belief()
        assert view.fold.to_bytes() == (await lab.sequential()).to_bytes() != told


def test_few_are_kept_and_the_older_the_fewer() -> None:
    offsets: list[int] = []
    for offset in range(10, 100_000, 10):
        offsets.insert(0, offset)
        dropped = set(thinned_out(offsets))
        offsets = [kept for kept in offsets if kept not in dropped]
    assert offsets[:3] == [99_990, 99_980, 99_970]
    assert offsets[-1] == 10
    assert len(offsets) < 60
    gaps = [(newer - older) / (100_000 - older) for newer, older in itertools.pairwise(offsets[3:])]
    assert max(gaps) < 0.6


async def test_a_full_disk_for_snapshots_stops_nothing(open_lab, at) -> None:
    async with open_lab(snapshot_every=5) as lab:
        await lab.room(tags=["E0"])
        await lab.belief()
        async with lab.sessions.write() as session:
            await session.execute(text("alter table snapshots rename to gone"))
            await session.commit()
        await tell(lab, at, 0, 20)
        assert (await lab.belief()).fold.to_bytes() == (await lab.sequential()).to_bytes()
        async with lab.sessions.write() as session:
            await session.execute(text("alter table gone rename to snapshots"))
            await session.execute(update(SnapshotRow).values(created_at=0))
            await session.commit()
