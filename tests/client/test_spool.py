"""The spool alone: order, numbers, bounds, ownership, and survival of kill -9."""

from __future__ import annotations

import contextlib
import resource
import signal
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tms_client import Spool, SpoolError, SpoolFull
from tms_schemas.observation import RawRead

NOW = datetime(2026, 1, 1, tzinfo=UTC)


def read(tag: str) -> RawRead:
    return RawRead(seq=0, observed_at=NOW, zone="z", tag=tag)


def test_numbers_wait_until_they_are_agreed(tmp_path):
    with Spool(tmp_path / "s", "a") as spool:
        spool.put("r", read("A"), read("B"))
        assert spool.peek(10) == []
        spool.continue_at(7)
        spool.put("r", read("C"))
        assert [item.seq for item in spool.peek(10)] == [7, 8, 9]
        assert len(spool) == 3


def test_a_batch_is_of_one_room(tmp_path):
    with Spool(tmp_path / "s", "a") as spool:
        spool.continue_at(0)
        for room in ("r", "r", "s", "r"):
            spool.put(room, read("A"))
        rooms = []
        while items := spool.peek(10):
            rooms.append([item.room for item in items])
            spool.acknowledge(items)
        assert rooms == [["r", "r"], ["s"], ["r"]]


def test_everything_survives_reopening(tmp_path):
    with Spool(tmp_path / "s", "a") as spool:
        spool.continue_at(0)
        labels = [spool.new_label() for _ in range(3)]
        spool.put("r", read("A"), read("B"), read("C"))
        spool.acknowledge(spool.peek(1))
        spool.bury(spool.peek(1)[0], "bad")
    with Spool(tmp_path / "s", "a") as spool:
        assert labels == ["a/1", "a/2", "a/3"]
        assert spool.new_label() == "a/4"
        assert [item.seq for item in spool.peek(5)] == [2]
        assert spool.next_seq == 3 and spool.buried == 1
        assert [(dead.seq, dead.reason) for dead in spool.dead_letters()] == [(1, "bad")]


def test_labels_of_a_lost_spool_do_not_return(tmp_path):
    with Spool(tmp_path / "s", "a", clock=lambda: 1000.0) as spool:
        first = spool.new_label()  # the server was not asked yet
        spool.continue_at(50, first_label=2_000_000)
        assert (first, spool.new_label()) == ("a/1000000", "a/2000000")


@pytest.mark.parametrize("bound", [{"max_items": 2}, {"max_bytes": 150}])
def test_a_full_spool_refuses_whole_and_counts(tmp_path, bound):
    with Spool(tmp_path / "s", "a", **bound) as spool:
        spool.continue_at(0)
        spool.put("r", read("A"))
        with pytest.raises(SpoolFull, match=r"1 observations .* wait"):
            spool.put("r", read("B"), read("C"))
        assert (len(spool), spool.refused, spool.next_seq) == (1, 2, 1)
        spool.acknowledge(spool.peek(9))
        spool.put("r", read("B"))
        assert [item.seq for item in spool.peek(9)] == [1]


@contextlib.contextmanager
def full_disk(path: Path):
    """No file may grow beyond what the log of the spool has now."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.with_name(path.name + "-wal").stat().st_size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_refuses_and_what_was_taken_stays(tmp_path):
    path = tmp_path / "s"
    with Spool(path, "a") as spool:
        spool.continue_at(0)
        spool.put("r", read("A"), read("B"))
        with full_disk(path):
            with pytest.raises(SpoolFull, match="spool of a: disk I/O error"):
                spool.put("r", read("C"))
            assert (len(spool), spool.next_seq) == (2, 2)
            items = spool.peek(9)
            with pytest.raises(SpoolError):
                spool.acknowledge(items)
            assert spool.peek(9) == items
        spool.put("r", read("D"))
        spool.acknowledge(items)
        assert [(item.seq, "D" in item.body) for item in spool.peek(9)] == [(2, True)]


def test_labels_given_while_the_disk_is_full_do_not_return(tmp_path):
    """Only what was taken names them, and their numbers are taken with it, whenever the power goes."""
    path = tmp_path / "s"
    spool = Spool(path, "a")
    spool.continue_at(0)
    first = spool.new_label()
    with full_disk(path):
        given = [spool.new_label() for _ in range(3)]
        assert len({first, *given}) == 4 and not spool.remembers
    spool.put("r", read("A"))
    assert spool.remembers
    spool.close()
    with Spool(path, "a") as again:
        assert again.new_label() not in {first, *given}
        with full_disk(path):
            lost = again.new_label()
    with Spool(path, "a") as again:
        assert again.new_label() == lost, "nothing that names it was ever taken"


def test_labels_given_while_the_disk_is_full_are_beyond_what_the_server_knows(tmp_path):
    path = tmp_path / "s"
    with Spool(path, "a", clock=lambda: 1000.0) as spool:
        with full_disk(path):
            first = spool.new_label()
            with pytest.raises(SpoolError):
                spool.continue_at(50, first_label=2_000_000)
            assert spool.new_label() == "a/1000001"
        spool.continue_at(50, first_label=2_000_000)
        assert (first, spool.new_label()) == ("a/1000000", "a/2000000") and spool.remembers


def test_dead_letters_are_bounded_and_counted(tmp_path):
    with Spool(tmp_path / "s", "a", max_dead=2) as spool:
        spool.continue_at(0)
        spool.put("r", *map(read, "ABCD"))
        for item in spool.peek(9):
            spool.bury(item, "bad")
        assert [dead.seq for dead in spool.dead_letters()] == [2, 3]
        assert (spool.buried, len(spool)) == (4, 0)


def test_acknowledging_twice_is_harmless(tmp_path):
    with Spool(tmp_path / "s", "a") as spool:
        spool.continue_at(0)
        spool.put("r", read("A"), read("B"))
        items = spool.peek(1)
        spool.acknowledge(items)
        spool.acknowledge(items)
        assert len(spool) == 1


def test_one_process_and_one_agent_per_file(tmp_path):
    with Spool(tmp_path / "s", "a"), pytest.raises(SpoolError, match="an agent with this spool is running already"):
        Spool(tmp_path / "s", "a")
    with pytest.raises(SpoolError, match="belongs to agent 'a'"):
        Spool(tmp_path / "s", "b")


def test_a_file_that_is_no_spool(tmp_path):
    (tmp_path / "s").write_text("something else entirely, long enough to be looked at as a header of a file")
    with pytest.raises(SpoolError, match="not a database"):
        Spool(tmp_path / "s", "a")


def test_a_place_where_none_can_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    for place, why in (("file/s", "exists|Not a directory"), (".", "unable to open")):
        with pytest.raises(SpoolError, match=why):
            Spool(tmp_path / place, "a")


STEPS = st.lists(st.sampled_from(["put", "put2", "ack", "bury", "agree", "reopen", "label"]), max_size=30)


@given(steps=STEPS)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_in_order_and_never_twice(steps, tmp_path_factory):
    """Whatever the sequence of calls: what leaves was put in, in order, under rising numbers; labels are unique."""
    path = tmp_path_factory.mktemp("spool") / "s"
    spool = Spool(path, "a")
    put, left, labels = 0, [], []
    for step in steps:
        if step.startswith("put"):
            count = 2 if step == "put2" else 1
            spool.put("r", *(read(f"T{put + i}") for i in range(count)))
            put += count
        elif step == "ack":
            items = spool.peek(2)
            left += items
            spool.acknowledge(items)
        elif step == "bury":
            for item in spool.peek(1):
                left.append(item)
                spool.bury(item, "bad")
        elif step == "agree":
            spool.continue_at(3)
        elif step == "label":
            labels.append(spool.new_label())
        else:
            spool.close()
            spool = Spool(path, "a")
    spool.continue_at(0)
    left += spool.peek(1000)
    spool.close()
    assert [item.body.split('"tag":"')[1].split('"')[0] for item in left] == [f"T{i}" for i in range(put)]
    assert [item.seq for item in left] == sorted({item.seq for item in left})
    assert len(set(labels)) == len(labels)


WRITER = """
import sys
from datetime import UTC, datetime
from tms_client import Spool
from tms_schemas.observation import RawRead
spool = Spool(sys.argv[1], "a")
spool.continue_at(0)
while True:
    label = spool.new_label()
    spool.put("r", RawRead(seq=0, observed_at=datetime.now(UTC), zone="z", tag=label.replace("/", ".")))
    print(label, flush=True)
"""


def test_kill_9_loses_nothing_that_was_put(tmp_path: Path):
    said: list[str] = []
    for round_ in range(3):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(tmp_path / "s")], stdout=subprocess.PIPE, text=True
        )
        assert writer.stdout is not None
        with writer, writer.stdout:
            for _ in range(20 + 7 * round_):
                said.append(writer.stdout.readline().strip())
            writer.send_signal(signal.SIGKILL)
            # what it still managed to say counts too, except a line cut in the middle
            said += [line.strip() for line in writer.stdout.readlines() if line.endswith("\n")]
    with Spool(tmp_path / "s", "a") as spool:
        stored = [item.body.split('"tag":"')[1].split('"')[0].replace(".", "/") for item in spool.peek(100_000)]
        assert [item.seq for item in spool.peek(100_000)] == list(range(len(stored)))
    assert len(set(said)) == len(said)
    assert {label.lower() for label in stored} >= set(said)
