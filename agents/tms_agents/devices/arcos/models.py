"""What the units of a robot mean, by the model that it tells when it is synchronised.

Source: parameter files of ARIA, as ``robot_params.cpp`` of p2os has them.
"""

from __future__ import annotations

#: Millimetres per unit of position. What ends in -sh has the newer controller (SH-2), which counts millimetres.
MM_PER_UNIT = {
    "amigo": 0.5083,
    "p2at": 1.32,
    "p2at8": 1.32,
    "p2at8+": 0.465,
    "p2ce": 0.826,
    "p2d8": 0.485,
    "p2d8+": 0.485,
    "p2de": 0.969,
    "p2df": 0.485,
    "p2dx": 0.84,
    "p2it": 1.136,
    "p2pb": 0.424,
    "p2pp": 0.485,
    "p3at": 0.465,
    "p3atiw": 0.3768,
    "p3dx": 0.485,
    "perfpb": 0.485,
    "perfpb+": 0.485,
}


def mm_per_unit(model: str) -> float | None:
    """None for a model that is not known."""
    name = model.lower()
    return 1.0 if "-sh" in name else MM_PER_UNIT.get(name)
