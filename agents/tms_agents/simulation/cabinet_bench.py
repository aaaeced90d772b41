"""The devices of one simulated cabinet: a load-cell board and a TR3 reader, byte for byte, over the physics of a board.

The physics keep real time: a board converts 50 times a second, whatever the speed of the story.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from tms_agents.cabinet.calibration_file import BoardCalibration
from tms_agents.devices.loadboard.emulator import RosTmsBoardDevice
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.simulation.board import BoardParameters, BoardWorld
from tms_agents.simulation.board_hands import HandParameters
from tms_agents.simulation.board_noise import CellParameters
from tms_agents.simulation.board_tags import TagParameters
from tms_agents.simulation.world import Cabinet, World, Xy

_ZONE = "board"
#: Distance of the cells from the edges of the board, metres.
_INSET_M = 0.05


class CabinetBench:
    """``board`` and ``reader`` are what is put behind lines; ``follow`` brings the things of the room onto the board.

    All calls must come from one thread.
    """

    def __init__(self, cabinet: Cabinet, rng: np.random.Generator, clock: Callable[[], float] = time.monotonic) -> None:
        self.cabinet = cabinet
        self.cells = cells_of(cabinet)
        self.physics = BoardWorld(_parameters(cabinet, self.cells), rng)
        self.board = RosTmsBoardDevice(self._counts, clock=clock)
        self.reader = Tr3Device(antennas=2)  # the reader has two plugs, a loop under the board is on the first
        self.reader.look = self._in_view
        self._covered: frozenset[str] = frozenset()
        self._clock, self._now = clock, clock()

    def follow(self, world: World) -> None:
        """Somebody puts or takes what came to or left this cabinet in the room; the hand takes its time.

        Raises:
            Impossible: a thing is taken while it is still being put.
        """
        self._advance()
        inside = world.inside(self.cabinet.id)
        self._covered = frozenset(world.covered)
        for tag in self.physics.things.keys() - inside.keys():
            self.physics.take(tag)
        for tag in sorted(inside.keys() - self.physics.things.keys()):
            self.physics.place(tag, world.things[tag].weight_g, self.cabinet.spots[inside[tag]], tag)

    def calibration(self) -> BoardCalibration:
        """What an installer measured with the empty board and a known weight."""
        zero = self.physics.grams(np.zeros(len(self.cells)))
        gain = self.physics.grams(np.ones(len(self.cells))) - zero
        return BoardCalibration(gain=[float(one) for one in gain], offset=[float(one) for one in -zero / gain])

    def _counts(self, now: float) -> Sequence[float]:
        self._advance()
        return self.physics.cell_counts().tolist()  # type: ignore[no-any-return]

    def _in_view(self, antenna: int) -> frozenset[str]:
        self._advance()
        return self.physics.tags_in_zone(_ZONE) - self._covered if antenna == 0 else frozenset()

    def _advance(self) -> None:
        """Let the physics catch up with the clock; while the antenna radiates, it disturbs the cells."""
        now = self._clock()
        self.physics.rf_on = self.reader.radiating == 0
        self.physics.step(now - self._now)
        self._now = now


def cells_of(cabinet: Cabinet) -> tuple[Xy, ...]:
    """Where the four cells are, in the order in which the board counts them."""
    left, right, near, far = _INSET_M, cabinet.width - _INSET_M, _INSET_M, cabinet.depth - _INSET_M
    return ((left, near), (right, near), (left, far), (right, far))


def _parameters(cabinet: Cabinet, cells: tuple[Xy, ...]) -> BoardParameters:
    """A well-made board in a quiet room, and people who do not dawdle: what is hard is for the benchmarks."""
    return BoardParameters(
        cells=cells,
        width=cabinet.width,
        depth=cabinet.depth,
        electronics=CellParameters(gram_per_count=0.5, noise_sd_g=2.0, vibration_g=0.0),
        hands=HandParameters(slow_share=0.0, quick_s=(0.2, 0.5), approach_s=(0.0, 0.1)),
        tags=TagParameters(miss_rate=0.0, stray_rate=0.0),
    )
