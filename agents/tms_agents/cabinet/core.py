"""A whole cabinet without I/O: what its devices say goes in, observations, states and a view of it come out."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any

from tms_agents.cabinet import CabinetEvent, KnownWeight
from tms_agents.cabinet.board import Board
from tms_agents.cabinet.calibration_file import BoardCalibration
from tms_agents.cabinet.config import CabinetConfig, ReaderSection
from tms_agents.cabinet.field_turns import FieldTurns
from tms_agents.cabinet.labels import Labels
from tms_agents.cabinet.rounds import Round, Rounds
from tms_agents.cabinet.single import anywhere
from tms_agents.cabinet.story import told
from tms_agents.clocks import Clocks
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.tags import Field, RoundEnd, TagItem
from tms_agents.devices.transport import DeviceState
from tms_agents.readers import tells_rounds
from tms_schemas.observation import Inventory, Observation, RawRead

log = logging.getLogger(__name__)
_STORY = 100
#: Samples of a board at rest are taken so many seconds at a time: ten at once cost little more than one. A load must be
#: steady for much longer than that to be told of, so nothing is told later for it.
_PATIENCE_S = 0.2


class Reader:
    """A tag reader: its rounds, whose turn it is, how it is."""

    def __init__(self, section: ReaderSection, boards: Sequence[str]) -> None:
        self.section, self.boards, self.field = section, tuple(boards), Field()
        self.rounds = Rounds(section.antennas, section.zone, section.window_s, tells_ends=tells_rounds(section.source))
        self.turns = (
            FieldTurns(self.field, section.weigh_s, section.antenna_count) if section.weigh_s is not None else None
        )
        self.state: DeviceState | None = None
        #: Tags of the last round by zone.
        self.seen: dict[str, frozenset[str]] = {}

    @property
    def delivers(self) -> bool:
        return self.state is not None and self.state.state == "connected"

    def line(self, state: DeviceState) -> None:
        self.state = DeviceState(state.state, f"{self.section.name}: {state.why}")
        if state.state != "connected":
            self.rounds.reset()
            self.seen.clear()

    def quiet(self, t: float) -> bool:
        """Whether cells are undisturbed now; a reader that is not there disturbs nobody."""
        return self.turns is None or not self.delivers or self.turns.quiet(t)


class Cabinet:
    """``new_label`` gives ids that were never used; ``saved`` is what ``to_dict`` of a former run gave, or nothing."""

    def __init__(
        self,
        config: CabinetConfig,
        calibrations: Mapping[str, BoardCalibration],
        clocks: Clocks,
        new_label: Callable[[], str],
        saved: Mapping[str, Any] | None = None,
    ) -> None:
        self.config, self._clocks = config, clocks
        self.boards = {
            one.name: Board(one, calibrations.get(one.name), config.board_zones(one.name)) for one in config.boards
        }
        self.readers = {
            one.name: Reader(one, [zone.board for zone in config.zones if zone.name in one.zone_names])
            for one in config.readers
        }
        self.labels = {
            one.name: Labels(
                one.frame(), new_label, clocks.utc, anywhere=None if one.cells else anywhere(one.width, one.depth)
            )
            for one in config.boards
        }
        self._last: dict[str, float] = {}
        #: What happened of late, for people: time of day and one line.
        self.story: deque[tuple[datetime, str]] = deque(maxlen=_STORY)
        for name, board in (saved or {}).get("boards", {}).items():
            self._restore(name, board)

    # what devices say; each returns what is to be posted

    def samples(self, board: str, samples: Sequence[LoadSample]) -> list[Observation]:
        """Samples that arrived just now, the oldest first; those disturbed by an antenna are left out."""
        now = self._clocks.now()
        if not self._quiet(board, now):
            return []
        last = max(self._last.get(board, now), now - 1.0)
        self._last[board] = now
        found: list[Observation] = []
        for n, sample in enumerate(samples, 1):
            t = last + (now - last) * n / len(samples)
            if events := self.boards[board].sample(t, sample):
                found += self._observations(board, events)
        return found

    def patience_s(self, board: str) -> float:
        """How long the next samples may wait for others: not while anything changes or antennas take turns with it."""
        turns = any(reader.turns is not None for reader in self.readers.values() if board in reader.boards)
        return _PATIENCE_S if self.boards[board].estimator.resting and not turns else 0.0

    def reads(self, reader: str, items: Sequence[TagItem]) -> tuple[list[Observation], set[str]]:
        """What a reader said just now: observations, and the tags that it read."""
        one, now = self.readers[reader], self._clocks.now()
        rounds = one.rounds.take(now, items)
        if one.turns is not None:
            for item in items:
                if isinstance(item, RoundEnd):
                    one.turns.round_over(now)
        return self._rounds(one, rounds)

    @property
    def ticks(self) -> bool:
        """Whether ``tick`` is needed: for readers that do not tell the end of their rounds, or take turns."""
        return any(one.turns is not None or not one.rounds.tells_ends for one in self.readers.values())

    def tick(self) -> tuple[list[Observation], set[str]]:
        """To be called ten times a second or so."""
        now = self._clocks.now()
        found: list[Observation] = []
        tags: set[str] = set()
        for reader in self.readers.values():
            if reader.turns is not None:
                reader.turns.tick(now)
            more, seen = self._rounds(reader, reader.rounds.tick(now, reader.delivers))
            found += more
            tags |= seen
        return found, tags

    def board_line(self, board: str, state: DeviceState) -> None:
        self.boards[board].line(self._clocks.now(), state)

    def reader_line(self, reader: str, state: DeviceState) -> None:
        self.readers[reader].line(state)

    def know(self, weights: Mapping[str, KnownWeight]) -> None:
        for board in self.boards.values():
            for tag, weight in weights.items():
                board.know(tag, weight)

    # what can be asked

    def states(self) -> dict[str, DeviceState]:
        """Of every device by name, once something is known of it."""
        found = {f"board {name}": board.state for name, board in self.boards.items()}
        found |= {f"reader {name}": reader.state for name, reader in self.readers.items()}
        return {name: state for name, state in found.items() if state is not None}

    def inventory(self) -> Inventory:
        labels = [
            label
            for name, board in self.boards.items()
            for label in self.labels[name].inventory(board.estimator.stays())
        ]
        return Inventory(seq=0, observed_at=self._clocks.utc(self._clocks.now()), labels=labels)

    def to_dict(self) -> dict[str, Any]:
        boards = {
            name: board.to_dict() | {"labels": {str(stay): label for stay, label in self.labels[name].of.items()}}
            for name, board in self.boards.items()
        }
        return {"t": self._clocks.now(), "boards": boards}

    # below: inside

    def _restore(self, name: str, saved: Mapping[str, Any]) -> None:
        if name not in self.boards:
            log.warning("board %s is in the saved state, but not in the configuration", name)
            return
        try:
            labels = {int(stay): str(label) for stay, label in saved["labels"].items()}
            self.boards[name].restore(saved)
            self.labels[name].of = labels
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            log.warning("the saved state of board %s does not fit, starting it anew: %s", name, error)

    def _quiet(self, board: str, now: float) -> bool:
        return all(reader.quiet(now) for reader in self.readers.values() if board in reader.boards)

    def _rounds(self, reader: Reader, rounds: Iterable[Round]) -> tuple[list[Observation], set[str]]:
        found: list[Observation] = []
        tags: set[str] = set()
        for one in rounds:
            tags |= one.tags - reader.seen.get(one.zone, frozenset())
            reader.seen[one.zone] = one.tags
            told_zone: set[tuple[str, str | None]] = set()
            for name in reader.boards:
                events = self.boards[name].inventory(one.t, one.zone, one.tags)
                for observation in self._observations(name, events) if events else []:
                    # An antenna over two boards reads a tag once.
                    if isinstance(observation, RawRead):
                        if (observation.zone, observation.tag) in told_zone:
                            continue
                        told_zone.add((observation.zone, observation.tag))
                    found.append(observation)
        return found, tags

    def _observations(self, board: str, events: Sequence[CabinetEvent]) -> list[Observation]:
        labels = self.labels[board]
        for event in events:
            self.story.append((self._clocks.utc(event.t), told(board, event)))
        return labels.observations(events)
