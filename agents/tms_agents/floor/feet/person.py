"""Which bodies are people."""

from __future__ import annotations

from typing import Any

from numba import njit


@njit(cache=True)
def is_person(body: Any) -> bool:
    """Whether it is believed to move, and is no robot."""
    return bool(body.used and body.confirmed and not body.robot)
