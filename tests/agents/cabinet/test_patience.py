"""How long samples of a board may wait for others: only while nothing happens on it."""

from __future__ import annotations

from cabinet_rig import Shelf, calibration_toml, config_toml

from tms_agents.cabinet.calibration_file import read_calibration
from tms_agents.cabinet.config import CabinetConfig
from tms_agents.cabinet.core import Cabinet
from tms_agents.clocks import Clocks
from tms_agents.config import read_config
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.transport import DeviceState
from tms_schemas.observation import LabelAppeared

READER = """[[readers]]
source = { kind = "tr3-serial", device = "/dev/null" }
zone = "shelf"
weigh_s = 1.0
[[zones]]
name = "shelf"
board = "shelf"
"""


class Bench:
    def __init__(self, folder, more: str = "") -> None:
        load = '{ kind = "ros-tms", device = "/dev/null" }'
        (folder / "cabinet.toml").write_text(config_toml("patience", "http://127.0.0.1:1", load, more=more))
        (folder / "cabinet.calibration.toml").write_text(calibration_toml("shelf"))
        config = read_config(folder / "cabinet.toml", CabinetConfig)
        calibrations = read_calibration(folder / "cabinet.calibration.toml")
        self.now = 1000.0
        self.shelf = Shelf()
        self.cabinet = Cabinet(
            config, calibrations, Clocks(lambda: self.now, lambda: self.now), iter(map(str, range(99))).__next__
        )
        self.cabinet.board_line("shelf", DeviceState("connected"))

    def run(self, seconds: float) -> tuple[list[object], list[float]]:
        """Samples at 50 Hz, handed over as a link does: what was found, and what patience there was."""
        found, patience, waiting = [], [], []
        for _ in range(round(seconds * 50)):
            self.now += 0.02
            waiting.append(LoadSample(values=tuple(self.shelf.counts(self.now))))
            patience.append(self.cabinet.patience_s("shelf"))
            if len(waiting) >= patience[-1] / 0.02:
                found += self.cabinet.samples("shelf", waiting)
                waiting = []
        return found, patience


def test_samples_wait_at_rest_and_not_until_everything_is_told(tmp_path):
    bench = Bench(tmp_path)
    bench.run(5.0)
    assert set(bench.run(2.0)[1]) == {0.2}
    bench.shelf.put("milk", 400.0, 0.2, 0.15)
    began = bench.now
    found, patience = bench.run(3.0)
    appeared = [one for one in found if isinstance(one, LabelAppeared)]
    assert len(appeared) == 1 and began < appeared[0].observed_at.timestamp() < began + 1.2
    told_after = 50 * (appeared[0].observed_at.timestamp() - began)
    hurried = [n for n, one in enumerate(patience) if one == 0.0]
    assert hurried[0] <= 10 and hurried[-1] >= 0.9 * told_after
    assert patience[-1] == 0.2


def test_samples_never_wait_where_an_antenna_takes_turns_with_the_cells(tmp_path):
    bench = Bench(tmp_path, READER)
    assert set(bench.run(4.0)[1]) == {0.0}
