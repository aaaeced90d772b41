"""The library against a real HTTP server: typed answers, errors, retries, names, pages; blocking and awaited alike."""

from __future__ import annotations

import inspect
import json
import random
import socket
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from typing import Any

import pytest

import tms_client
from tms_client import AsyncTown, Retry, Town
from tms_client import aio as aio_module
from tms_client import town as town_module
from tms_client.maps import awaited as awaited_maps
from tms_client.maps import blocking as blocking_maps
from tms_schemas.objects import ObjectFields
from tms_schemas.observation import LabelAppeared, ObservationBatch

NOW = "2026-11-20T10:00:00Z"


def thing(tag: str, name: str, **more: Any) -> dict[str, Any]:
    return {"tag": tag, "name": name, "created_at": NOW, "updated_at": NOW, **more}


def location(tag: str, **more: Any) -> dict[str, Any]:
    slices = [
        {"label": "floor/7", "p": 0.25, "kind": "floor", "xy": [1.0, 2.0]},
        {"label": "cabinet/2", "p": 0.75, "kind": "cabinet", "xy": [3.0, 4.0], "furniture": "cabinet-a", "new": 1},
    ]
    answer = {"tag": tag, "name": "tea bottle", "room": "r", "at": NOW, "cursor": 9, "distribution": slices}
    answer |= {"furniture": [{"id": "cabinet-a", "name": "Cabinet A", "p": 0.75}], "holders": [], "rooms": []}
    answer |= {"best": {"label": "cabinet/2", "p": 0.75, "xy": [3.0, 4.0]}, "entropy_bits": 0.81}
    return answer | {"last_direct_evidence": None, "staleness_s": None, **more}


@pytest.fixture
def slept() -> list[float]:
    return []


@pytest.fixture
def town(fake, slept):
    with Town(fake.url, key="secret", retry=Retry(random=random.Random(1)), sleep=slept.append) as town:
        yield town


def test_where_by_name(fake, town):
    fake.pages["/v1/objects"] = {"items": [thing("A1", "Tea Bottle"), thing("A2", "tea bottle lid")]}
    fake.pages["/v1/objects/A1/location"] = location("A1")
    answer = town.where("tea  bottle")
    assert answer.best is not None and answer.best.label == "cabinet/2"
    assert answer.top is not None and answer.top.p == 0.75
    assert answer.p("cabinet/2", "floor/7") == 1.0
    assert not answer.certain()
    assert [place.label for place in answer.places] == ["cabinet/2", "floor/7"]
    assert fake.requests[0][2]["authorization"] == "Bearer secret"


async def test_where_awaited(fake):
    fake.pages["/v1/objects"] = {"items": [thing("A1", "お茶", synonyms=["tea bottle"]), thing("A2", "tea bottle lid")]}
    fake.pages["/v1/objects/A1/location"] = location("A1")
    async with AsyncTown(fake.url) as town:
        assert (await town.where("ｔｅａ bottle")).tag == "A1"


def test_where_by_tag_asks_once(fake, town):
    fake.pages["/v1/objects/E00401004E17F97A/location"] = location("E00401004E17F97A")
    assert town.where("E00401004E17F97A").tag == "E00401004E17F97A"
    assert len(fake.requests) == 1


def test_where_travels_in_time(fake, town):
    fake.pages["/v1/objects/E00401004E17F97A/location"] = location("E00401004E17F97A")
    town.where("E00401004E17F97A", at=datetime(2026, 11, 20, 9, tzinfo=UTC))
    assert fake.requests[-1][1].endswith("?at=2026-11-20T09%3A00%3A00%2B00%3A00")


def test_ambiguous_name_lists_the_candidates(fake, town):
    fake.pages["/v1/objects"] = {"items": [thing("A1", "tea bottle"), thing("A2", "tea bottle")]}
    with pytest.raises(tms_client.Ambiguous, match=r"tea bottle \(A1\), tea bottle \(A2\)") as caught:
        town.where("tea bottle")
    assert [one.tag for one in caught.value.candidates] == ["A1", "A2"]


def test_unknown_name(fake, town):
    fake.pages["/v1/objects"] = {"items": []}
    with pytest.raises(tms_client.NotFound, match="no object is called 'tea bottle'"):
        town.where("tea bottle")


def test_a_short_tag_that_search_does_not_find(fake, town):
    fake.pages["/v1/objects"] = {"items": []}
    fake.pages["/v1/objects/T1/location"] = location("T1")
    assert town.where("T1").tag == "T1"


def test_search_walks_all_pages(fake, town):
    fake.pages["/v1/objects?q=tea&area=0.0%2C0.0%2C1.5%2C2.0"] = {"items": [thing("A", "a")], "next_cursor": "x y"}
    fake.pages["/v1/objects?q=tea&area=0.0%2C0.0%2C1.5%2C2.0&cursor=x+y"] = {"items": [thing("B", "b")]}
    assert [one.tag for one in town.objects.search("tea", area=(0, 0, 1.5, 2))] == ["A", "B"]


def test_objects_are_written_as_given(fake, town):
    fake.script += [(200, {}, thing("A:1", "cup")), (200, {}, thing("A:1", "cup")), (204, {}, None)]
    assert town.objects.put("A:1", ObjectFields(name="cup", size_m=0.1)).name == "cup"
    town.objects.patch("A:1", room=None)
    town.objects.delete("A:1")
    (put, patch, delete) = fake.requests
    assert (put[0], json.loads(put[3])) == ("PUT", {"name": "cup", "size_m": [0.1, 0.1, 0.1]})
    assert (patch[0], json.loads(patch[3])) == ("PATCH", {"room": None})
    assert delete[0] == "DELETE"


def test_a_tag_that_was_not_read_stays_null_on_the_wire(fake, town):
    """A reader that read nothing (null) is not the same as no reader (absent)."""
    when = datetime(2026, 1, 1, tzinfo=UTC)
    common: dict[str, Any] = {"observed_at": when, "label": "a/1", "kind": "cabinet", "xy": (0, 0)}
    items = [LabelAppeared(seq=0, **common), LabelAppeared(seq=1, tag=None, **common)]
    assert town.post(ObservationBatch(agent="a", room="r", observations=items)).accepted == 2
    first, second = fake.received("a")
    assert "tag" not in first and second["tag"] is None


@pytest.mark.parametrize(
    ("status", "error"),
    [
        (400, tms_client.BadRequest),
        (401, tms_client.Unauthenticated),
        (403, tms_client.Forbidden),
        (404, tms_client.NotFound),
        (409, tms_client.Conflict),
        (413, tms_client.TooLarge),
        (422, tms_client.Invalid),
        (418, tms_client.ServerFault),
        (500, tms_client.ServerFault),
    ],
)
def test_problems_become_exceptions_at_once(fake, town, slept, status, error):
    items = [{"where": "/observations/3/xy", "why": "not finite", "index": 3, "seq": 17}]
    fake.script.append((status, {}, {"title": "T", "status": status, "detail": "what happened", "items": items}))
    with pytest.raises(error, match=f"{status} what happened: /observations/3/xy: not finite") as caught:
        town.placements("r")
    assert caught.value.items[0].seq == 17
    assert slept == []


def test_an_error_page_that_is_no_problem(fake, town):
    fake.script.append((404, {"content-type": "text/html"}, "<html>"))
    with pytest.raises(tms_client.NotFound, match="404 Not Found"):
        town.placements("r")


def test_an_answer_that_is_not_the_wire(fake, town):
    fake.pages["/v1/rooms/r/placements"] = {"room": "r"}
    with pytest.raises(tms_client.BadAnswer, match="placements"):
        town.placements("r")


@pytest.mark.parametrize("status", [429, 503])
def test_busy_is_waited_out_for_as_long_as_the_server_says(fake, town, slept, status):
    fake.script += [(status, {"retry-after": "3"}, {"title": "Busy", "status": status}), (status, {}, "")]
    fake.pages["/v1/rooms/r/placements"] = {"room": "r", "at": None, "cursor": 0, "objects": []}
    assert town.placements("r").room == "r"
    assert 3.0 < slept[0] <= 3.1 and slept[1] <= 0.2 and len(slept) == 2


def test_retry_after_as_a_date(fake, town, slept):
    date = format_datetime(datetime.now(UTC) + timedelta(seconds=20), usegmt=True)
    fake.script.append((503, {"retry-after": date}, ""))
    fake.pages["/v1/rooms/r/placements"] = {"room": "r", "at": None, "cursor": 0, "objects": []}
    town.placements("r")
    assert 18 < slept[0] < 22.2  # both dates are whole seconds, and up to 0.1 s is added


def test_busy_for_too_long_is_raised(fake, town, slept):
    fake.script += [(503, {}, {"title": "Busy", "status": 503})] * 6
    with pytest.raises(tms_client.Busy):
        town.placements("r")
    assert len(slept) == 5 and len(fake.requests) == 6


def test_a_retry_after_beyond_patience_is_raised_at_once(fake, town, slept):
    fake.script.append((429, {"retry-after": "3600"}, {"title": "Busy", "status": 429}))
    with pytest.raises(tms_client.Busy) as caught:
        town.placements("r")
    assert caught.value.retry_after_s == 3600 and slept == []


def test_unreachable_after_growing_pauses(slept):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    retry = Retry(attempts=5, random=random.Random(2))
    town = Town(f"http://127.0.0.1:{port}", retry=retry, sleep=slept.append)
    with town, pytest.raises(tms_client.Unreachable):
        town.placements("r")
    assert all(0.05 * 2**n <= pause <= 0.1 * 2**n for n, pause in enumerate(slept)) and len(slept) == 4


@pytest.mark.parametrize("url", ["ftp://host", "localhost:8080", "http://host:port"])
def test_an_address_that_cannot_be(url):
    with pytest.raises(tms_client.TownError, match="cannot be used"):
        Town(url)


def test_both_clients_have_the_same_methods():
    for blocking, awaited in (
        (Town, AsyncTown),
        (town_module.Objects, aio_module.Objects),
        (town_module.Products, aio_module.Products),
        (town_module.Rooms, aio_module.Rooms),
        (town_module.Agents, aio_module.Agents),
        (blocking_maps.Maps, awaited_maps.AsyncMaps),
        (blocking_maps.Map, awaited_maps.AsyncMap),
    ):
        methods = {name for name in vars(blocking) if not name.startswith("_")} - {"close"}
        assert methods == {name for name in vars(awaited) if not name.startswith("_")} - {"aclose"}
        for name in methods:
            one, other = (inspect.signature(getattr(kind, name)) for kind in (blocking, awaited))
            assert list(one.parameters.values()) == list(other.parameters.values()), name


def test_where_command_speaks_plainly(fake, capsys):
    from tms_client import cli

    fake.pages["/v1/objects"] = {"items": [thing("A1", "tea bottle")]}
    evidence = {"agent": "hand", "seq": 3, "type": "raw_read", "label": None, "observed_at": NOW}
    fake.pages["/v1/objects/A1/location"] = location("A1", last_direct_evidence=evidence, staleness_s=200.0)
    assert cli.main(["where", "tea", "bottle", "--url", fake.url]) == 0
    assert capsys.readouterr().out == (
        "tea bottle (A1) in r:\n"
        "   75.0%  in the cabinet, Cabinet A (cabinet-a) at x 3.00 m, y 4.00 m [cabinet/2]\n"
        "   25.0%  on the floor at x 1.00 m, y 2.00 m [floor/7]\n"
        "  its tag was last read 3 minutes before by hand\n"
    )


def test_where_command_fails_in_one_line(fake, capsys):
    from tms_client import cli

    fake.pages["/v1/objects"] = {"items": []}
    assert cli.main(["where", "unicorn", "--url", fake.url]) == 2
    assert capsys.readouterr().err == "tms: 404 no object is called 'unicorn'\n"
