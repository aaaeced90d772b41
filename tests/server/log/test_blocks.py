"""Blocks keep every record exactly, whatever an agent sends together, and come out in fold order."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tms_server.db.times import to_us
from tms_server.ingest.admission import admit
from tms_server.log.blocks import SPAN_US, Block, cut, records
from tms_server.log.bodies import Unreadable
from tms_server.log.merging import Merge, start
from tms_server.log.record import ORIGIN, Batch, Position, Record

START = datetime(2026, 11, 21, 9, 0, tzinfo=UTC)

#: Seconds after the start, and the step from one seq to the next: mostly as agents send, sometimes not.
moments = st.lists(
    st.tuples(st.one_of(st.integers(0, 5), st.integers(-200, 200)), st.sampled_from([1, 1, 1, 1, 2, 50])),
    min_size=1,
    max_size=12,
)


def batch(agent: str, sent: list[tuple[int, int]], first_seq: int = 0) -> Batch:
    seq, observations = first_seq, []
    for second, step in sent:
        seq += step
        at = (START + timedelta(seconds=second)).isoformat()
        observations.append({"seq": seq, "observed_at": at, "type": "label_vanished", "label": f"{agent}/{seq}"})
    return admit(json.dumps({"agent": agent, "room": "lab", "observations": observations}).encode())


def read_again(block: Block) -> Block:
    """As it comes from the database."""
    return Block._make(tuple(block))


@given(moments, st.one_of(st.none(), st.integers(-200, 200)), st.data())
def test_every_record_comes_back(sent: list[tuple[int, int]], horizon_s: int | None, data: st.DataObject) -> None:
    given_batch = batch("a", sent)
    chosen = sorted(data.draw(st.sets(st.integers(0, len(sent) - 1), min_size=1)))
    horizon = None if horizon_s is None else to_us(START) + horizon_s * 1_000_000
    written = cut(given_batch, chosen, 7, 99, horizon)
    found = [record for block, _ in written for record in records(read_again(block))]
    assert found == [record for block, said in written for record in records(block, said)]
    assert [record.content for record in found] == [given_batch.observations[i] for i in chosen]
    assert [record.offset for record in found] == list(range(8, 8 + len(chosen)))
    for record in found:
        assert (record.seq, record.observed_at) == (record.content.seq, to_us(record.content.observed_at))  # type: ignore[union-attr]
        assert record.late == (horizon is not None and record.observed_at < horizon)
    for block, _ in written:
        times = [record.observed_at for record in records(block)]
        assert (block.first_at, block.last_at) == (min(times), max(times))
        assert block.last_at - block.first_at <= SPAN_US


@given(
    st.lists(st.tuples(st.sampled_from(["a", "b", "c"]), moments), min_size=1, max_size=8),
    st.integers(1, 4),
    st.integers(-250, 250),
    st.one_of(st.none(), st.integers(-250, 250)),
)
def test_pages_of_blocks_come_out_in_fold_order(
    sent: list[tuple[str, list[tuple[int, int]]]], page: int, after_s: int, until_s: int | None
) -> None:
    blocks: list[Block] = []
    for n, (agent, seconds) in enumerate(sent):
        one = batch(agent, seconds, first_seq=n * 10_000)
        blocks += [b for b, _ in cut(one, range(len(seconds)), blocks[-1].offset if blocks else 0, 0, None)]
    everything = sorted((r for block in blocks for r in records(block)), key=lambda record: record.position)
    after = Position(to_us(START) + after_s * 1_000_000, "b", 0)
    until = None if until_s is None else Position(to_us(START) + until_s * 1_000_000, "b", 0)
    head = blocks[len(blocks) // 2].offset
    expected = [
        r for r in everything if r.position > after and r.offset <= head and (until is None or r.position <= until)
    ]
    blocks.sort(key=start)
    merge, found = Merge(after=after, until=until, head=head), list[Record]()
    for at in range(0, len(blocks), page):
        found += merge.take(blocks[at : at + page], more=at + page < len(blocks))
    assert found == expected


def test_white_space_is_not_kept() -> None:
    sent = {"agent": "a", "room": "lab", "observations": [pose(0)]}
    roomy = json.dumps(sent).encode().replace(b": ", b":" + b" " * 100_000)
    ((block, _),) = cut(admit(roomy), [0], 0, 0, None)
    assert len(block.body) < 500
    assert [record.content for record in records(block)] == list(admit(roomy).observations)


def test_what_another_version_wrote_is_read_as_far_as_it_goes() -> None:
    """An observation with a field more, and one of a type nobody knows any more: the others are not lost."""
    body = {
        "agent": "a",
        "room": "lab",
        "observations": [pose(0) | {"mood": "good"}, pose(1) | {"type": "smell"}, pose(2)],
    }
    block = Block("lab", 3, "a", 0, 3, 5, 5, 5, False, json.dumps(body))
    first, second, third = records(block)
    assert first.kind == third.kind == "pose"
    assert isinstance(second.content, Unreadable) and second.content.kind == "smell"
    assert second.position > ORIGIN


def pose(seq: int) -> dict[str, Any]:
    return {"seq": seq, "observed_at": START.isoformat(), "type": "pose", "label": "a/1", "pose": [1, 2, 0.5]}
