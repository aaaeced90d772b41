"""The demo: a server, the room registered in it, and the experiment played by agents over HTTP."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from tms_agents.simulation import pies
from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.floor_choice import say_if_it_compiles, why_no_laser
from tms_agents.simulation.idle import afternoon
from tms_agents.simulation.player import Player
from tms_agents.simulation.room import FLOOR_AGENT, description
from tms_agents.simulation.room_map import RoomMap, mapping
from tms_agents.simulation.service import server
from tms_agents.simulation.stage import UTC_NOW, staged
from tms_agents.simulation.story import MOVED, STEPS, furnish
from tms_agents.simulation.terminal import Terminal
from tms_client import NotFound, Retry, Town, TownError
from tms_client.cli import CommandError
from tms_schemas.objects import ObjectFields, ProductIn

#: The mapper compiles at its first start; then the story may be over before the map is there.
PATIENCE_S = 60.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """How to play: against ``url``, or a server of our own with its data in ``data_dir``.

    ``port``: 0 is a free one; None is the usual one, or a free one where that is taken. ``laser``: an emulated
    laser sees the floor; None: if it can (see ``floor_choice``).
    """

    url: str | None = None
    key: str | None = None
    room: str = "demo"
    port: int | None = None
    data_dir: Path | None = None
    weights: bool = False
    once: bool = False
    speed: float = 1.0
    laser: bool | None = None
    seed: int = 0


def run(
    plan: Plan,
    terminal: Terminal,
    clock: Callable[[], datetime] = UTC_NOW,
    sleep: Callable[[float], object] = time.sleep,
) -> bool:
    """Play the story; True where every pie was as expected. Goes on living until Ctrl-C unless ``plan.once``."""
    no_laser = why_no_laser(plan.laser, plan.speed)
    with ExitStack() as stack:
        work = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tms-demo-")))
        url = plan.url or stack.enter_context(server(plan.data_dir or work / "data", plan.port, terminal.say))
        terminal.headline(url, plan.room)
        town = stack.enter_context(Town(url, plan.key, retry=Retry(attempts=8)))
        try:
            register(town, plan)
            drawn = stack.enter_context(mapping(town, plan.room, work, plan.seed, terminal.say))
            terminal.say("starting the agents ...")
            if no_laser is None:
                say_if_it_compiles(terminal.say)
            stage, player = stack.enter_context(
                staged(
                    town,
                    url,
                    plan.key,
                    plan.room,
                    work,
                    seed=plan.seed,
                    speed=plan.speed,
                    laser=no_laser is None,
                    clock=clock,
                    sleep=sleep,
                )
            )
            terminal.devices(stage.hardware.plugs, stage.configs, {} if no_laser is None else {FLOOR_AGENT: no_laser})
            player.play(furnish(player.world))
            right = _story(town, player, plan, terminal, drawn)
            if drawn is not None:
                drawn.poll(terminal.say, PATIENCE_S)
            if not plan.once:
                terminal.say(f"\nThe room lives on; look at {url}/ (Ctrl-C ends it).")
                player.play(afternoon(player.world, np.random.default_rng(plan.seed)))
        except TownError as error:
            raise CommandError(str(error)) from error
    return right


def register(town: Town, plan: Plan) -> None:
    """The room, the products and the ten objects, with weights only where the plan says so.

    Objects that a former demo left are registered anew: they are outside until they come into the room again.
    """
    town.rooms.put(plan.room, description(seed=plan.seed))
    for item in ITEMS:
        weights = {"weight_g": item.weight_g, "weight_sd_g": 1.0} if plan.weights else {}
        town.products.put(item.jan, ProductIn(name=item.name, category=item.category, **weights))
        with contextlib.suppress(NotFound):
            town.objects.delete(item.tag)
        town.objects.put(
            item.tag,
            ObjectFields(name=item.name, synonyms=list(item.synonyms), jan=item.jan, room=plan.room),
        )


def _story(town: Town, player: Player, plan: Plan, terminal: Terminal, drawn: RoomMap | None) -> bool:
    wrong = 0
    for number, step in enumerate(STEPS):
        if drawn is not None:
            drawn.poll(terminal.say)
        terminal.step(number, step.title)
        player.play(step.act(player.world))
        found = pies.pies_of(town.placements(plan.room), MOVED)
        off = pies.differences(step.expected(plan.weights), found)
        terminal.pies(found, off)
        wrong += len(off)
    terminal.verdict(wrong, weighed=plan.weights)
    if plan.weights:
        terminal.say(
            "Weight told objects 3 and 4 apart in step (5), before the tag was read; "
            "without it both are 1/2 - 1/2 until then."
        )
    return wrong == 0
