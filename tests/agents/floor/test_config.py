"""The configuration of a floor agent: examples for every device, one clear line for what is wrong."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from floor_rig import config_toml, laser_toml

import tms_agents.floor
from tms_agents.config import read_config
from tms_agents.floor.config import FloorConfig
from tms_client import cli
from tms_client.cli import CommandError

EXAMPLES = sorted((Path(tms_agents.floor.__file__).parent / "examples").glob("*.toml"))
LASER = laser_toml('{ kind = "scip", device = "/dev/null" }')
SCIP = 'kind = "scip", device = "/dev/null"'
LMS, COLA = 'kind = "lms200", device = "/dev/null"', 'kind = "cola", host = "h"'
SCENE = "[scene]\nregion = [[0, 0], [5, 0], [5, 4]]\nseats = [[[1, 1], [2, 1], [2, 2]]]\n"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_are_valid(path):
    config = read_config(path, FloorConfig)
    for laser in config.lasers:
        assert laser.source.link(1.0) is not None
    assert config.calibration_path(path).name == f"{path.stem}.calibration.toml"


def test_there_is_an_example_for_each_device_and_each_part_of_a_room():
    text = "".join(path.read_text() for path in EXAMPLES)
    assert set(re.findall(r'kind = "([^"]+)"', text)) == {"scip", "lms200", "cola"}
    for word in (
        "host =",
        "device =",
        "gates",
        "masks",
        "seats",
        "mirrors",
        "[[robots]]",
        "[recording]",
        "upside_down",
    ):
        assert word in text


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("pose =", "poze ="), "lasers.0.pose: Field required"),
        (("theta =", "theta = 99, tetha ="), "lasers.0.pose.theta"),
        (('kind = "scip"', 'kind = "urg"'), "lasers.0.source: Input tag 'urg'"),
        ((', device = "/dev/null"', ""), "give either device (serial) or host and port (TCP)"),
        (('device = "/dev/null"', 'device = "/dev/null", cluster = 0'), "lasers.0.source.scip.cluster"),
        (('device = "/dev/null"', 'device = "/dev/null", angle_min = 1.0, angle_max = -1.0'), "angle_min must be less"),
        (
            ('kind = "scip", device = "/dev/null"', 'kind = "lms200", device = "/dev/null", resolution_deg = 0.25'),
            "0.25 degrees go with an angle of 100",
        ),
        (
            ('kind = "scip", device = "/dev/null"', 'kind = "lms200", device = "/dev/null", baud = 115200'),
            "lasers.0.source.lms200.baud",
        ),
        ((SCIP, f"{LMS}, unit = 'inch'"), "lasers.0.source.lms200.unit: Input should be 'cm' or 'mm'"),
        ((SCIP, f"{LMS}, measuring_mode = 7"), "lasers.0.source.lms200: measuring mode 07 measures no distances"),
        (
            (SCIP, f"{LMS}, output = 'partial'"),
            "lasers.0.source.lms200.output: Input should be 'stream', 'reflectivity'",
        ),
        (
            (SCIP, f"{LMS}, fixed = true, angle_deg = 180"),
            "lms200: angle_deg and resolution_deg are not set where they",
        ),
        ((SCIP, f"{SCIP}, polled = 2"), "lasers.0.source.scip.polled: Input should be a valid boolean"),
        ((SCIP, f"{COLA}, passwords = []"), "lasers.0.source.cola.passwords: Tuple should have at least 1 item"),
        ((SCIP, f"{COLA}, passwords = ['main']"), "lasers.0.source.cola.passwords.0: Input should be a valid integer"),
        ((SCIP, f"{COLA}, field_deg = [0, 180]"), "lasers.0.source.cola: a pace or field of view is set together with"),
        ((SCIP, f"{COLA}, resolution_deg = 1, field_deg = [180, 0]"), "cola: a field of view goes from the smaller"),
        (
            ('kind = "scip", device = "/dev/null"', 'kind = "cola", host = "h", frequency_hz = 25'),
            "set together with a resolution",
        ),
        (("[5, 4]]", "[5, 0]]"), ": scene.region: a polygon without an area"),
        (("[[1, 1], [2, 1], [2, 2]]", "[[1, 1], [2, 1]]"), "scene.seats.0"),
        (("[scene]", "[scene]\nmirrors = [[[1, 1], [1, 1]]]"), ": scene.mirrors: a mirror must be at least 5 cm wide"),
        (("[scene]", "[[robots]]\nwidth = -1\nlength = 1\n[scene]"), "robots.0.width"),
        (("[scene]", "[estimator]\nlearn = 1\n[scene]"), ": estimator.learn: Extra inputs are not permitted"),
        (("[scene]", "[estimator]\nlearn_s = 0\n[scene]"), ": estimator.learn_s: Input should be greater than 0"),
        (("[scene]", '[recording]\npath = "scans.bin"\n[scene]'), "the name of a recording ends in .scans"),
        (("heartbeat_s = 1.0", 'feet = "legs"'), "feet: Extra inputs are not permitted"),
        (("[scene]", LASER + "[scene]"), ": lasers.1.name: two lasers are called 'laser'"),
        (
            ("[scene]", LASER.replace('"laser"', '"other"') + "[scene]"),
            ": lasers.1.source: laser 'laser' is at /dev/null already",
        ),
        (
            ("[[0, 0], [5, 0], [5, 4]]", "[[0, 0], [5, 4], [5, 0], [0, 3]]"),
            ": scene.region: its sides 1 and 3 cross: give the corners in the order of a walk around it",
        ),
        (
            ("seats = [", "seats = [[[0, 0], [1, 1], [1, 0], [0, 2]], "),
            ": scene.seats.0: its sides 1 and 3 cross: give the corners",
        ),
        (
            ("[[[1, 1], [2, 1], [2, 2]]]", "[[1, 1], [2, 1], [2, 2]]"),
            ": scene.seats: a list of seats is wanted, this is a single one: put [ ] around it",
        ),
        (("[scene]", "[scene]\nmirrors = [[1, 1], [2, 1]]"), "a list of mirrors is wanted"),
        (
            ("[[lasers]]", "[lasers]"),
            ": lasers: this section is given once for each: write [[lasers]], with two",
        ),
        (
            ("[scene]", "[robots]\nwidth = 1\nlength = 1\n[scene]"),
            ": robots: this section is given once for each: write",
        ),
        (("[scene]", "[[scene]]"), ": scene: there is one such section: write [scene], with one bracket\n"),
        (("[spool]", "[[spool]]"), ": spool: there is one such section: write [spool], with one bracket\n"),
        (("[scene]", "[[robots]]\nwidth = 45\nlength = 45\n[scene]"), "robots.0.width: Input should be less than or"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capsys, change, says):
    path = tmp_path / "floor.toml"
    good = config_toml("lab", "http://127.0.0.1:1", LASER, more=SCENE)
    assert change[0] in good
    path.write_text(good.replace(*change))
    assert cli.main(["agent", "floor", "--config", str(path)]) == 2
    out, err = capsys.readouterr()
    assert says in err and err.startswith(f"tms: {path}: ") and err.count("\n") == 1 and not out


def test_two_layers_of_one_scanner_are_two_lasers(tmp_path):
    path = tmp_path / "floor.toml"
    low, high = (laser_toml(f"{{ {COLA}, layer = {n} }}", name=f"layer {n}") for n in (0, 1))
    path.write_text(config_toml("lab", "http://127.0.0.1:1", low + high))
    assert len(read_config(path, FloorConfig).lasers) == 2


def test_scene_and_settings_reach_the_estimator(tmp_path):
    path = tmp_path / "floor.toml"
    more = SCENE + "[[robots]]\nwidth = 0.4\nlength = 0.5\n[estimator]\nlearn_s = 3.0\n"
    path.write_text(config_toml("lab", "http://127.0.0.1:1", LASER, more=more))
    config = read_config(path, FloorConfig)
    assert config.settings().learn_s == 3.0
    scene = config.room_scene()
    assert scene.robots == ((0.4, 0.5),) and len(scene.seats) == 1
    assert not config.tells_robots


def test_a_calibration_that_cannot_be(tmp_path, capsys):
    path = tmp_path / "floor.toml"
    path.write_text(config_toml("lab", "http://127.0.0.1:1", LASER))
    (tmp_path / "floor.calibration.toml").write_text('["laser"]\nx = 1.0\n')
    assert cli.main(["agent", "floor", "--config", str(path)]) == 2
    assert "floor.calibration.toml: laser.y: Field required" in capsys.readouterr().err
    with pytest.raises(CommandError):
        read_config(tmp_path / "none.toml", FloorConfig)
