"""Households for the cabinet benchmark, from easy to hard; "unseen" ones were not looked at while tuning."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tms_agents.cabinet import KnownWeight
from tms_agents.simulation.board import BoardParameters, BoardWorld
from tms_agents.simulation.board_hands import HandParameters
from tms_agents.simulation.board_life import Household, LifeParameters
from tms_agents.simulation.board_noise import CellParameters
from tms_agents.simulation.board_tags import TagParameters, ZoneBox


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    board: BoardParameters = field(default_factory=BoardParameters)
    life: LifeParameters = field(default_factory=LifeParameters)

    def open(self, seed: int, *, even: bool = False) -> tuple[BoardWorld, Household, dict[str, KnownWeight]]:
        """A world, who lives there, and what the object database says of the tagged things' weights.

        ``even``: the board is asked at an even pace, not on the beat of our drivers.
        """
        matter, people, scales = np.random.default_rng(seed).spawn(3)
        world = BoardWorld(replace(self.board, even=even), matter)
        household = Household(world, self.life, people)
        known = {}
        for name, tag in household.tags.items():
            weight = household.weights[name]
            sd = max(2.0, 0.02 * weight)
            known[tag] = KnownWeight(weight + sd * float(scales.standard_normal()), sd)
        return world, household, known


_STRANGERS = ("E0040200000000F1", "E0040200000000F2")
_CABINET = BoardParameters(tags=TagParameters(strangers=_STRANGERS))
#: A refrigerator's board after the laboratory's other launch file, seen from above and moved to positive numbers.
_FRIDGE_CELLS = ((0.02, 0.02), (0.33, 0.02), (0.02, 0.36), (0.33, 0.36))

#: Slow changes are ramps: nobody presses, trembles, leans on the board or slides a thing; everything else as it is.
_RAMPS = replace(_CABINET, hands=HandParameters(press_share=0.0, press_g=0.0, tremor_share=0.0))

SCENES: dict[str, Scene] = {
    # Noise, coarse counts, creep, vibration, antenna noise, missed and false reads, slow changes; one thing at a time,
    # and two at once in 15 % of the episodes.
    "ramps": Scene(board=_RAMPS, life=LifeParameters(pair_share=0.0, lean_share=0.0, slide_share=0.0)),
    "ramps, pairs": Scene(board=_RAMPS, life=LifeParameters(lean_share=0.0, slide_share=0.0)),
    # One thing at a time, quick, all tagged and not light, nothing shakes, every tag is read every time, and a soft
    # board: a rigid one relieves far corners, which the absolute values of the laboratory's algorithm cannot see.
    "easy": Scene(
        board=replace(
            _CABINET,
            torsion=0.0,
            electronics=CellParameters(noise_sd_g=3.0, rf_noise_factor=1.0, vibration_g=0.0, drift_g=0.0),
            hands=HandParameters(
                slow_share=0.0, quick_s=(0.1, 0.2), press_share=0.1, press_g=0.0, approach_s=(0.6, 1.2)
            ),
            tags=TagParameters(miss_rate=0.0, stray_rate=0.0),
        ),
        life=LifeParameters(
            tagged_share=1.0, weight_g=(100.0, 1500.0), pair_share=0.0, lean_share=0.0, slide_share=0.0
        ),
    ),
    # The defaults: what the laboratory's board is said to be.
    "cabinet": Scene(board=_CABINET),
    # The same with cells that get stuck for a while, and power cuts.
    "faults": Scene(board=_CABINET, life=LifeParameters(stuck_share=0.03, power_share=0.05)),
}

UNSEEN: dict[str, Scene] = {
    "noisy": Scene(
        board=replace(
            _CABINET,
            electronics=CellParameters(noise_sd_g=12.0, rf_noise_factor=2.5, drift_g=10.0, creep_per_hour=0.02),
            tags=TagParameters(strangers=_STRANGERS, miss_rate=0.10, stray_rate=0.02, period_s=0.8, on_s=0.3),
        )
    ),
    "fridge": Scene(
        board=replace(
            _CABINET,
            cells=_FRIDGE_CELLS,
            width=0.35,
            depth=0.38,
            electronics=CellParameters(vibration_g=30.0, vibration_on_s=120.0, vibration_off_s=90.0),
        )
    ),
    "six cells": Scene(
        board=replace(
            _CABINET,
            cells=((0.03, 0.03), (0.4, 0.03), (0.77, 0.03), (0.03, 0.35), (0.4, 0.35), (0.77, 0.35)),
            stiffness=(1.0, 1.3, 0.9, 1.1, 0.8, 1.0),
            width=0.8,
            depth=0.38,
            tags=TagParameters(
                zones=(ZoneBox("left", high=(0.4, 1.0)), ZoneBox("right", low=(0.4, -1.0))), strangers=_STRANGERS
            ),
        ),
        life=LifeParameters(things=20, most_on_board=9),
    ),
    "hasty": Scene(
        board=replace(_CABINET, hands=HandParameters(slow_share=0.5, press_share=0.8, press_g=200.0)),
        life=LifeParameters(rest_s=(4.0, 8.0), pair_share=0.3, lean_share=0.1, tagged_share=0.6),
    ),
    "soft board": Scene(board=replace(_CABINET, torsion=0.2)),
    "coarse": Scene(
        board=replace(_CABINET, electronics=CellParameters(gram_per_count=10.0, noise_sd_g=2.0, gain_error_sd=0.003))
    ),
}
