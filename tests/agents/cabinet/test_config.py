"""The configuration of a cabinet agent: examples for every device, one clear line for what is wrong."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from cabinet_rig import config_toml

import tms_agents.cabinet
from tms_agents.cabinet.config import CabinetConfig
from tms_agents.cabinet.sources import open_loads
from tms_agents.config import read_config
from tms_client import cli
from tms_client.cli import CommandError

EXAMPLES = sorted((Path(tms_agents.cabinet.__file__).parent / "examples").glob("*.toml"))
BOARD = '{kind = "ros-tms", device = "/dev/null"}'
READER = '{kind = "tr3-serial", device = "/dev/null"}'


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_are_valid(path):
    config = read_config(path, CabinetConfig)
    for board in config.boards:
        assert board.geometry().count >= 3
        assert open_loads(board.load, 1.0) is not None
        assert config.board_zones(board.name) or not config.readers
    assert config.calibration_path(path).name == f"{path.stem}.calibration.toml"


def test_there_is_an_example_for_each_device():
    text = "".join(path.read_text() for path in EXAMPLES)
    kinds = {"ros-tms", "and", "mt-sics", "openscale", "modbus", "tr3-serial", "tr3-tcp", "llrp", "thingmagic"}
    assert set(re.findall(r'kind = "([^"]+)"', text)) >= kinds


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("width", "widht"), "boards.0.widht: Extra inputs are not permitted"),
        (("width = 0.465", "width = -1"), "boards.0.width: Input should be greater than 0"),
        (("[0.425, 0.27]", "[0.9, 0.27]"), "every cell must be on the board"),
        ((", [0.425, 0.27]]", "]"), "3 cell positions, but load delivers 4"),
        (("[0.04, 0.27], [0.425, 0.27]", "[0.2, 0.047], [0.3, 0.047]"), "not on one line"),
        (('kind = "ros-tms"', 'kind = "rostms"'), "boards.0.load.0: Input tag 'rostms'"),
        ((', device = "/dev/null"}', "}"), "give either device (serial) or host and port (TCP)"),
        (('device = "/dev/null"}', 'host = "h"}'), "host needs port"),
        (('device = "/dev/null"}', 'device = "/dev/null", baud = 1}'), "baud: Input should be greater than or equal"),
        (("theta = ", "theta = 99, tetha = "), "boards.0.pose.theta"),
        (('zone = "shelf"', 'zone = "shelve"'), ": readers.0: there is no zone 'shelve' (there are shelf)"),
        (('zone = "shelf"\n', ""), ": readers.0: reader 'reader' needs zone or zones"),
        (('board = "shelf"', 'board = "shelve"'), ": zones.0.board: there is no board 'shelve' (there are shelf)"),
        (('[[zones]]\nname = "shelf"', '[[zones]]\nname = "shelves"'), ": readers.0: there is no zone 'shelf' (there"),
        (('surface = "cabinet/shelf"', "estimator = {settle = 1}"), ": boards.0.estimator.settle: Extra inputs"),
        (('surface = "cabinet/shelf"', "estimator = {settle_s = -1}"), ": boards.0.estimator.settle_s: Input should"),
        (("heartbeat_s = 1.0", "heartbeat_s = 0"), "heartbeat_s: Input should be greater than 0"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capsys, change, says):
    path = tmp_path / "cabinet.toml"
    text = config_toml("lab", "http://127.0.0.1:9", BOARD, reader=READER)
    assert change[0] in text
    path.write_text(text.replace(*change))
    for command in (["agent", "cabinet"], ["cabinet", "calibrate", "--weight", "500"], ["cabinet", "watch", "--once"]):
        assert cli.main([*command, "--config", str(path)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert says in line


@pytest.mark.parametrize("what", ["board", "reader"])
def test_two_of_one_name_are_named(tmp_path, what):
    path = tmp_path / "cabinet.toml"
    text = config_toml("lab", "http://127.0.0.1:9", BOARD, reader=READER)
    head, rest = text.split(f"[[{what}s]]\n", 1)
    own = rest.split("\n[", 1)[0] + "\n"
    path.write_text(f"{head}[[{what}s]]\n{own}[[{what}s]]\n{rest}")
    with pytest.raises(CommandError, match=rf": {what}s.1.name: two {what}s are called '[a-z]+': give each its name$"):
        read_config(path, CabinetConfig)


def test_weighing_with_the_field_off_needs_a_reader_that_can(tmp_path):
    path = tmp_path / "cabinet.toml"
    reader = '{kind = "llrp", host = "h"}\nweigh_s = 0.5'
    path.write_text(config_toml("lab", "http://127.0.0.1:9", BOARD, reader=reader))
    with pytest.raises(CommandError, match="llrp reader cannot switch its field off"):
        read_config(path, CabinetConfig)


def test_a_board_of_raw_counts_needs_a_calibration(tmp_path, capsys):
    path = tmp_path / "cabinet.toml"
    path.write_text(config_toml("lab", "http://127.0.0.1:9", BOARD))
    assert cli.main(["agent", "cabinet", "--config", str(path)]) == 2
    assert "board 'shelf' has no calibration: run tms cabinet calibrate" in capsys.readouterr().err
    (tmp_path / "cabinet.calibration.toml").write_text("[shelf]\ngain = [1.0]\noffset = [0.0]\n")
    assert cli.main(["agent", "cabinet", "--config", str(path)]) == 2
    assert "is for 1 cells, the board has 4" in capsys.readouterr().err


def test_a_missing_extra_is_one_line(tmp_path):
    path = tmp_path / "cabinet.toml"
    load = '{kind = "modbus", host = "127.0.0.1", port = 9, registers = [0, 2, 4, 6]}'
    path.write_text(config_toml("lab", "http://127.0.0.1:9", load))
    block = "import sys; sys.modules.update(dict.fromkeys(('pymodbus', 'numba', 'scipy', 'fastapi')))"
    command = (
        f"{block}; from tms_client.cli import main; sys.exit(main(['agent', 'cabinet', '--config', {str(path)!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2 and "[modbus]" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_grams_need_none(tmp_path):
    path = tmp_path / "cabinet.toml"
    path.write_text(config_toml("lab", "http://127.0.0.1:9", '{kind = "and", device = "/dev/null"}', cells=False))
    config = read_config(path, CabinetConfig)
    assert config.boards[0].cell_count == 1 and config.boards[0].zeroes_itself
