"""What ``tms cabinet watch`` shows, as plain JSON: made by the agent, read by the screen."""

from __future__ import annotations

import math
from typing import Any

from tms_agents.cabinet.board import Board
from tms_agents.cabinet.core import Cabinet, Reader
from tms_agents.clocks import Clocks
from tms_agents.devices.transport import DeviceState


def view_of(cabinet: Cabinet, clocks: Clocks, source: str) -> dict[str, Any]:
    """``source``: who looks at the devices, "agent" or "devices"."""
    now = clocks.now()
    return {
        "agent": cabinet.config.agent,
        "room": cabinet.config.room,
        "source": source,
        "at": clocks.utc(now).isoformat(timespec="milliseconds"),
        "boards": [_board(board, cabinet, now) for board in cabinet.boards.values()],
        "readers": [_reader(name, reader) for name, reader in cabinet.readers.items()],
        "story": [(at.isoformat(timespec="milliseconds"), text) for at, text in cabinet.story],
    }


def _board(board: Board, cabinet: Cabinet, now: float) -> dict[str, Any]:
    section, labels = board.section, cabinet.labels[board.name].of
    grams = [None if math.isnan(one) else round(float(one), 1) for one in board.grams]
    cells = board.geometry.cells if section.cells else ((section.width / 2, section.depth / 2),)
    return {
        "name": board.name,
        "width": section.width,
        "depth": section.depth,
        "state": _state(board.state),
        "knows_load": board.estimator.knows_load,
        "cells": [{"xy": xy, "grams": one} for xy, one in zip(cells, grams, strict=True)],
        "stays": [
            {
                "id": one.id,
                "label": labels.get(one.id, ""),
                "xy": one.xy if section.cells else None,
                "sd": math.sqrt(max(one.cov[0], one.cov[2], 0.0)) if section.cells else None,
                "weight_g": round(one.weight_g, 1),
                "weight_sd_g": round(one.weight_sd_g, 1),
                "tag": one.tag,
                "age_s": round(max(0.0, now - one.since), 1),
            }
            for one in board.estimator.stays()
        ],
    }


def _reader(name: str, reader: Reader) -> dict[str, Any]:
    return {
        "name": name,
        "state": _state(reader.state),
        "zones": {zone: sorted(tags) for zone, tags in reader.seen.items()},
    }


def _state(state: DeviceState | None) -> dict[str, str]:
    return {"state": "connecting", "why": ""} if state is None else {"state": state.state, "why": state.why}
