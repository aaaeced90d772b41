"""The page in Chromium while the paper's experiment is played."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect
from server_process import ServerProcess

from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.demo import Plan, register
from tms_agents.simulation.player import Player
from tms_agents.simulation.room import description
from tms_agents.simulation.stage import staged
from tms_agents.simulation.story import STEPS, Step, furnish
from tms_client import Town
from tms_schemas.maps import MapIn

from .conftest import Watched


class Story:
    """The experiment, one step at a time."""

    def __init__(self, player: Player) -> None:
        self._player = player

    def play(self, *steps: Step) -> None:
        for step in steps:
            self._player.play(step.act(self._player.world))


@contextmanager
def story(url: str, folder: Path) -> Iterator[Story]:
    with Town(url) as town:
        register(town, Plan())
        with staged(town, url, None, "demo", folder, seed=0, speed=10.0) as (_, player):
            player.play(furnish(player.world))
            yield Story(player)


def test_the_experiment_is_seen_as_it_happens(server: ServerProcess, watched: Watched, tmp_path: Path) -> None:
    page = watched.page
    with story(server.url, tmp_path) as told:
        page.goto(server.url)
        expect(page.get_by_role("heading", level=1)).to_have_text("Care room (simulated)")
        expect(page.locator("#pies > li")).to_have_count(10)

        told.play(STEPS[0])
        expect(page.locator('[data-kind="cabinet"] circle.mark')).to_have_count(10)
        expect(page.locator("#connection")).to_have_attribute("data-state", "live")
        assert slices(page, 2) == {own_colour(page, "cabinet-a", 2): pytest.approx(1.0, abs=0.02)}

        told.play(STEPS[1])
        expect(mover(page, "person")).to_have_attribute("data-count", "3")
        assert [slices(page, number) for number in (2, 3, 4)] == [{"#ffffff": pytest.approx(1.0, abs=0.02)}] * 3

        told.play(STEPS[2])
        expect(page.locator('[data-kind="floor"] rect.mark')).to_have_count(1)
        expect(mover(page, "person")).to_have_attribute("data-count", "2")
        orange = page.locator('[data-kind="floor"] .mark').get_attribute("fill")
        for number in (2, 3, 4):
            third = {"#ffffff": pytest.approx(2 / 3, abs=0.02), orange: pytest.approx(1 / 3, abs=0.02)}
            assert slices(page, number) == third

        told.play(STEPS[3])
        expect(page.locator('[data-kind="robot"] circle.mark')).to_have_attribute("r", "8")
        expect(mover(page, "robot")).to_have_attribute("data-count", "1")
        half = {"#ffffff": pytest.approx(0.5, abs=0.02), orange: pytest.approx(0.5, abs=0.02)}
        assert [slices(page, number) for number in (3, 4)] == [half] * 2
        expect(card(page, 2)).to_contain_text("robot's hand")

        told.play(STEPS[4])
        expect(page.locator('[data-kind="table"] circle.ring')).to_have_attribute("fill", "none")
        expect(card(page, 2)).to_have_attribute("data-places", re.compile(r"^on Table > 99 %"))
        expect(mover(page, "robot")).to_have_attribute("data-count", "0")

        told.play(STEPS[5], STEPS[6])
        expect(card(page, 3)).to_have_attribute("data-places", re.compile(r"^on the floor 9\d %"))
        expect(card(page, 4)).to_have_attribute("data-places", re.compile(r"^in Cabinet B > 99 %"))
        expect(mover(page, "person")).to_have_attribute("data-count", "0")
    host = urlsplit(server.url).netloc
    assert {urlsplit(url).netloc for url in watched.requests} == {host}


def test_where_is_it_in_words_and_by_keyboard(server: ServerProcess, watched: Watched, tmp_path: Path) -> None:
    page = watched.page
    with story(server.url, tmp_path) as told:
        told.play(*STEPS[:4])
        page.goto(server.url)
        expect(page.locator("#pies > li")).to_have_count(10)
        page.get_by_label("Where is").fill("お茶のボトル？")
        page.keyboard.press("Enter")
        answer = page.locator("#answer-text")
        expect(answer).to_contain_text(re.compile(r"Tea bottle is probably .*on the floor \(\d\d %\)"))
        expect(answer).to_contain_text(re.compile(r"with the person \((?:49|5[0-2]) %\)"))
        expect(card(page, 3)).to_be_focused()
        expect(page.locator("#plan")).to_have_class(re.compile("pointing"))
        expect(page.locator('[data-kind="floor"]')).to_have_class(re.compile("pointed"))
        expect(page.locator('[data-kind="cabinet"]').first).not_to_have_class(re.compile("pointed"))
        expect(card(page, 3)).to_have_accessible_name(re.compile(r"^Tea bottle: .*with the person (?:49|5[0-2]) %"))
        page.keyboard.press("Tab")
        expect(card(page, 4)).to_be_focused()
        page.get_by_label("Where is").fill("unicorn")
        page.get_by_role("button", name="Find").click()
        expect(answer).to_have_text("No object is called “unicorn”.")


def test_the_page_outlives_the_server(tmp_path: Path, watched: Watched) -> None:
    page = watched.page
    watched.expected = ["ERR_CONNECTION_REFUSED", "WebSocket", "ERR_EMPTY_RESPONSE", "ERR_SOCKET_NOT_CONNECTED"]
    with ServerProcess(tmp_path) as server:
        with Town(server.url) as town:
            register(town, Plan())
        page.goto(server.url)
        expect(page.locator("#connection")).to_have_attribute("data-state", "live")
        port = urlsplit(server.url).port
    assert port is not None
    expect(page.locator("#connection")).to_have_attribute("data-state", "lost")
    expect(page.locator("#pies > li")).to_have_count(10)
    with ServerProcess(tmp_path, port=port) as server:
        with story(server.url, tmp_path) as told:
            told.play(STEPS[0])
        expect(page.locator("#connection")).to_have_attribute("data-state", "live", timeout=30_000)
        expect(card(page, 2)).to_contain_text("Cabinet A")
        expect(page.locator("#connection-text")).to_contain_text("as of")
    expect(page.locator("#connection-text")).to_contain_text("stale since")


def test_names_are_text_and_rooms_can_be_chosen(server: ServerProcess, watched: Watched) -> None:
    evil = '<img src=x onerror="document.title=1"><script>alert(1)</script>'
    page = watched.page
    with Town(server.url) as town:
        town.rooms.put("a", description().model_copy(update={"name": "First"}))
        room = description().model_copy(update={"name": evil})
        room.furniture[0].name = evil
        town.rooms.put("b", room)
        httpx.put(f"{server.url}/v1/objects/E0040150AA", json={"name": evil, "room": "b"}).raise_for_status()
    page.goto(server.url)
    expect(page.get_by_role("heading", level=1)).to_have_text("First")
    expect(page.locator("#empty")).to_be_visible()
    page.get_by_label("Room").select_option("b")
    expect(page.get_by_role("heading", level=1)).to_have_text(evil)
    expect(page.locator("#pies h2")).to_have_text(evil)
    expect(page.locator('[data-furniture="cabinet-a"] text')).to_have_text(evil)
    assert page.locator("main img, main script").count() == 0
    page.reload()
    expect(page.get_by_role("heading", level=1)).to_have_text(evil)


def test_maps_lie_where_they_belong(server: ServerProcess, watched: Watched) -> None:
    """A map turned by a quarter: 2 m long and 1 m wide, from (2, 1) up and to the left."""
    page = watched.page
    with Town(server.url) as town:
        register(town, Plan())
        town.maps.put("demo", MapIn(room="demo", resolution=0.1, map_to_room=(2.0, 1.0, math.pi / 2)))
        town.maps.put("elsewhere", MapIn(room="demo", resolution=0.1))  # nobody knows where it lies
        for name in ("demo", "elsewhere"):
            town.maps.upload(name, np.ones((10, 20)), (0.0, 0.0), agent="robot")
        page.goto(server.url)
        image = page.locator("image.map")
        expect(image).to_have_count(1)
        walls, shown = page.locator(".walls").bounding_box(), image.bounding_box()
        assert walls is not None and shown is not None
        metre = walls["width"] / 6.0
        left, bottom = shown["x"] - walls["x"], walls["y"] + walls["height"] - shown["y"] - shown["height"]
        found = [value / metre for value in (left, bottom, shown["width"], shown["height"])]
        assert found == pytest.approx([1.0, 1.0, 1.0, 2.0], abs=0.1)


def test_a_server_with_keys_asks_for_one(server: ServerProcess, watched: Watched, tmp_path: Path) -> None:
    page = watched.page
    watched.expected = ["401"]
    with Town(server.url) as town:
        register(town, Plan())
    key = make_key(tmp_path)
    page.wait_for_timeout(1500)  # the server notices new keys within a second
    page.goto(server.url)
    dialog = page.get_by_role("dialog", name="This server asks for a key")
    expect(dialog).to_be_visible()
    dialog.get_by_label("API key").fill("tms_wrong_key")
    dialog.get_by_role("button", name="Log in").click()
    expect(dialog.get_by_role("alert")).to_have_text("the key is unknown or revoked")
    dialog.get_by_label("API key").fill(key)
    dialog.get_by_role("button", name="Log in").click()
    expect(page.locator("#pies > li")).to_have_count(10)
    expect(dialog).not_to_be_visible()
    subprocess.run([*KEYS, "revoke", key.split("_")[1], "--data-dir", str(tmp_path)], check=True, capture_output=True)
    expect(dialog).to_be_visible()


def test_a_phone_in_the_dark_shows_all_without_scrolling_sideways(server: ServerProcess, watched: Watched) -> None:
    page = watched.page
    with Town(server.url) as town:
        register(town, Plan())
    page.set_viewport_size({"width": 360, "height": 780})
    page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    page.goto(server.url)
    expect(page.locator("#pies > li")).to_have_count(10)
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(15, 21, 27)"


def test_the_icon_and_the_api_page_need_no_internet(server: ServerProcess, watched: Watched) -> None:
    assert httpx.get(f"{server.url}/favicon.ico").headers["content-type"] == "image/svg+xml"
    answer = httpx.get(server.url)
    assert "script-src 'self'" in answer.headers["content-security-policy"]
    assert httpx.get(f"{server.url}/page/main.js", headers={"If-None-Match": "x"}).headers["etag"]
    assert httpx.get(f"{server.url}/page/../app.py").status_code == 404
    assert httpx.get(f"{server.url}/page/missing.js").headers["content-type"] == "application/problem+json"


KEYS = [sys.executable, "-m", "tms_client", "keys"]


def make_key(data_dir: Path) -> str:
    arguments = [*KEYS, "create", "wall", "--scope", "read:demo", "--data-dir", str(data_dir)]
    out = subprocess.run(arguments, check=True, capture_output=True, text=True).stdout
    found = re.search(r"tms_\w+", out)
    assert found is not None
    return found[0]


def card(page: Page, number: int):  # type: ignore[no-untyped-def]
    return page.locator(f'#pies > [data-object="{ITEMS[number].tag}"]')


def mover(page: Page, kind: str):  # type: ignore[no-untyped-def]
    return page.locator(f'[data-mover="{kind}"]')


def slices(page: Page, number: int) -> dict[str, float]:
    """Colour -> probability as drawn."""
    drawn = (
        card(page, number)
        .locator(".slice")
        .evaluate_all("all => all.map(one => [one.getAttribute('fill'), Number(one.dataset.p)])")
    )
    return dict(drawn)


def own_colour(page: Page, agent: str, number: int) -> str:
    """The colour of the label that holds an object: of the mark whose title names it."""
    marks = page.locator(f'[data-label^="{agent}/"]')
    found = marks.filter(has_text=ITEMS[number].name).locator(".mark").get_attribute("fill")
    assert found is not None
    return found
