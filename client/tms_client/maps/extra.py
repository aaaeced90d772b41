"""numpy is no part of the light install."""

from __future__ import annotations

import importlib.util

from tms_client.errors import TownError


def need_numpy() -> None:
    """Raises ``TownError`` that says what to install."""
    if importlib.util.find_spec("numpy") is None:
        raise TownError('maps as arrays need numpy: pip install "robot-town-tms[maps]"')
