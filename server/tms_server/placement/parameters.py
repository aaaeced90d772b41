"""Parameters of the placement model (format ``placement-events/1``) and their three profiles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal

Profile = Literal["scenario", "live", "paper"]
EXCLUSIVE = ("cabinet", "floor", "robot", "table")


class ParameterError(ValueError):
    """A parameter is unknown or out of range; the message names it."""


def _alpha() -> dict[str, float]:
    return {"cabinet": 0.98, "robot": 0.99, "table": 0.99, "floor": 0.9, "mover": 0.95, "handover": 0.99}


def _zeros() -> dict[str, float]:
    return dict.fromkeys(EXCLUSIVE, 0.0)


@dataclass(frozen=True, slots=True)
class Parameters:
    """Model parameters; distances in metres, weights in grams, the rest probabilities or switches.

    Two parameters go beyond the event format. ``p_correction`` is how far a person's correction is trusted.
    ``keep_empty_ghosts`` false forgets a ghost as soon as no hypothesis holds an object there, which a room that
    runs for months needs; the format keeps ghosts for ever.
    """

    sigma_m: float = 0.5
    gate_m: float | None = None
    mover_choice: Literal["all", "holding"] = "all"
    alpha: Mapping[str, float] = field(default_factory=_alpha)
    p_read: float = 0.95
    use_null_reads: bool = True
    p_phantom: Mapping[str, float] = field(default_factory=_zeros)
    p_jump: float = 0.0
    p_occlude: Mapping[str, float] = field(default_factory=_zeros)
    sigma_ghost_m: float = 0.15
    ghost_weight: float = 1.0
    use_weight: bool = True
    weight_sd_g: float = 5.0
    weight_range_g: float = 3000.0
    use_size: bool = True
    size_sd_m: float = 0.02
    size_range_m: float = 0.5
    p_return: float = 0.0
    use_handover: bool = True
    p_handover: float = 0.1
    use_swap: bool = True
    prune_eps: float = 0.0
    p_correction: float = 0.999
    keep_empty_ghosts: bool = True

    @classmethod
    def of(cls, *overrides: Mapping[str, Any], profile: Profile = "scenario") -> Parameters:
        """The defaults, then the profile, then each mapping in turn; dictionaries merge per key.

        Raises:
            ParameterError: an unknown name, or a value out of range.
        """
        values: dict[str, Any] = asdict(cls())
        for layer in (PROFILES[profile], *overrides):
            for name, value in layer.items():
                if name not in values:
                    raise ParameterError(f"unknown parameter {name!r}")
                if isinstance(values[name], dict):
                    if not isinstance(value, Mapping):
                        raise ParameterError(f"parameter {name} must be a mapping of kinds, got {value!r}")
                    values[name] = {**values[name], **value}
                else:
                    values[name] = value
        return cls(**{name: _checked(name, value) for name, value in values.items()})._consistent()

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; ``Parameters.of(p.to_dict()) == p``."""
        return {f.name: dict(v) if isinstance(v := getattr(self, f.name), Mapping) else v for f in fields(self)}

    def _consistent(self) -> Parameters:
        for kind, phantom in self.p_phantom.items():
            if phantom + self.p_jump > 1:
                raise ParameterError(f"p_phantom[{kind}] + p_jump exceeds 1")
        return self


#: The information that the paper's filter has: no weights, sizes, null reads, hand-overs or returns.
PAPER: Mapping[str, Any] = {
    "mover_choice": "holding",
    "use_null_reads": False,
    "use_weight": False,
    "use_size": False,
    "p_phantom": _zeros(),
    "p_jump": 0.0,
    "p_occlude": _zeros(),
    "p_return": 0.0,
    "use_handover": False,
    "use_swap": False,
}

#: A room in daily use: nothing is impossible, and debounced readers (identifiers carry a checksum) rarely lie.
LIVE: Mapping[str, Any] = {
    "alpha": {"cabinet": 0.998, "robot": 0.999, "table": 0.999},
    "p_jump": 0.003,
    "p_return": 0.01,
    "p_phantom": {"cabinet": 0.002, "floor": 0.01, "robot": 0.001, "table": 0.001},
    "p_occlude": {"floor": 0.05},
    "prune_eps": 1e-12,
    "keep_empty_ghosts": False,
}

PROFILES: Mapping[str, Mapping[str, Any]] = {"scenario": {}, "live": LIVE, "paper": PAPER}

_SWITCHES = {"use_null_reads", "use_weight", "use_size", "use_handover", "use_swap", "keep_empty_ghosts"}
_POSITIVE = {"sigma_m", "sigma_ghost_m", "weight_sd_g", "weight_range_g", "size_sd_m", "size_range_m"}
_AT_LEAST_0 = {"ghost_weight", "gate_m"}


def _checked(name: str, value: Any) -> Any:
    if name in _SWITCHES:
        if not isinstance(value, bool):
            raise ParameterError(f"parameter {name} must be true or false, got {value!r}")
        return value
    if name == "mover_choice":
        if value not in ("all", "holding"):
            raise ParameterError(f"parameter mover_choice must be all or holding, got {value!r}")
        return value
    if name == "gate_m" and value is None:
        return None
    if isinstance(value, Mapping):
        for kind in value:
            if kind not in (*EXCLUSIVE, "mover", "handover"):
                raise ParameterError(f"parameter {name} has no kind {kind!r}")
        return {kind: _number(f"{name}[{kind}]", v, 0.0, 1.0) for kind, v in value.items()}
    if name in _POSITIVE:
        return _number(name, value, 1e-9, 1e9)
    if name in _AT_LEAST_0:
        return _number(name, value, 0.0, 1e9)
    return _number(name, value, 0.0, 1.0)


def _number(name: str, value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(f"parameter {name} must be a finite number, got {value!r}")
    if not low <= value <= high:
        raise ParameterError(f"parameter {name} must be between {low:g} and {high:g}, got {value:g}")
    return float(value)
