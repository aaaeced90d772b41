"""A SCIP session with an emulated sensor: what it learns, every mode, refusals, disturbed lines, restarts."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from device_conversation import DisturbedLine
from hypothesis import given, settings
from hypothesis import strategies as st
from scip_conversation import Sensor

from tms_agents.devices.scip import MODELS, ScipSettings
from tms_agents.devices.scip.measurements import STAMP_TURN_MS
from tms_agents.devices.transport import DeviceFault


def after_setup(sensor: Sensor) -> list[str]:
    """The commands of the handshake, once there are scans."""
    assert sensor.scans(0.5)
    return [command for command in sensor.device.heard if not command.startswith("G")]


@pytest.mark.parametrize("model", MODELS)
def test_every_model_is_set_up_and_seen(model):
    sensor = Sensor(model)
    scans = sensor.scans(1.0)
    p = sensor.device.model.parameters
    assert len(scans) == pytest.approx(p.scan / 60, abs=2)
    assert all(sensor.is_seen(scan) and scan.sweep is scans[0].sweep for scan in scans)
    np.testing.assert_array_equal(scans[0].sweep.angles, sensor.device.sweep.angles)
    times = [scan.device_time_s for scan in scans]
    np.testing.assert_allclose(np.diff(times), scans[0].sweep.period_s, atol=0.0011)
    assert times[0] % scans[0].sweep.period_s == pytest.approx(p.amin * 60 / p.scan / p.ares, abs=0.0011)
    assert (scans[0].intensities is not None) == sensor.device.model.coding.intensity
    assert sensor.session.ready and sensor.session.note.startswith(sensor.device.model.product)


def test_an_old_sensor_is_led_into_scip_2():
    assert after_setup(Sensor("URG-04LX")) == ["QT", "SCIP2.0", "QT", "PP", "VV", "II", "MD0044072501000"]


def test_a_model_without_intensity_is_never_asked_for_it():
    sensor = Sensor("URG-04LX-UG01")
    assert "ME" not in {command[:2] for command in after_setup(sensor)}
    assert sensor.session.note.endswith("H1510998, without intensity: the model has none")
    sensor = Sensor("URG-04LX-UG01", ScipSettings(intensity="required"))
    with pytest.raises(DeviceFault, match=r"URG-04LX\(Hokuyo Automatic Co.,Ltd.\) has no intensity"):
        sensor.scans(0.5)
    sensor = Sensor("URG-04LX-UG01", ScipSettings(intensity="off"))
    assert sensor.scans(0.5) and "intensity" not in sensor.session.note


def test_intensity_that_is_refused():
    sensor = Sensor("UST-20LX")
    sensor.device.refuse["ME"] = "0E"
    scans = sensor.scans(0.5)
    assert scans[0].intensities is None and sensor.is_seen(scans[0])
    assert sensor.session.note == "UST-20LX H1614935, without intensity: status 0E undefined command"
    sensor.settings = ScipSettings(intensity="required")
    sensor.connect()
    with pytest.raises(DeviceFault, match="ME: status 0E undefined command; its state: sensor is working normally"):
        sensor.scans(0.5)


def test_clusters_skipped_scans_and_a_part_of_the_view():
    sensor = Sensor("UTM-30LX", ScipSettings(cluster=4, skip=2, angle_min=-math.pi / 2, angle_max=math.pi / 2))
    scans = sensor.scans(1.0)
    assert "ME0180090004200" in sensor.device.heard
    assert len(scans) == pytest.approx(1.0 / 0.075, abs=2) and scans[0].sweep.period_s == pytest.approx(0.075)
    np.testing.assert_allclose(np.diff([scan.device_time_s for scan in scans]), 0.075, atol=0.0011)
    whole = sensor.device.sweep.angles[180:901]
    assert len(scans[0].ranges) == len(scans[0].sweep.angles) == 181
    assert scans[0].sweep.angles[0] == pytest.approx(whole[:4].mean()) and scans[0].sweep.angles[-1] == whole[-1]
    ranges, light = sensor.seen
    nearest = [180 + at + int(np.nanargmin(ranges[180 + at : min(184 + at, 901)])) for at in range(0, 721, 4)]
    np.testing.assert_allclose(scans[0].ranges, ranges[nearest])
    np.testing.assert_array_equal(scans[0].intensities, light[nearest])


def test_short_ranges():
    sensor = Sensor("URG-04LX-UG01", ScipSettings(short=True))
    sensor.seen[0][:3] = 4.2, 5.0, 4.094
    (scan, *_) = sensor.scans(0.5)
    assert scan.ranges[:3].tolist() == [math.inf, math.inf, 4.094] and scan.sweep.range_max_m == 4.094
    np.testing.assert_allclose(scan.ranges[3:], sensor.seen[0][3:])


@pytest.mark.parametrize(
    ("model", "options", "command"),
    [
        ("URG-04LX", {}, "GD0044072501"),
        ("URG-04LX", {"short": True}, "GS0044072501"),
        ("UST-10LX", {}, "GE0000108001"),
    ],
)
def test_scans_that_are_asked_for(model, options, command):
    sensor = Sensor(model, ScipSettings(polled=True, skip=1, **options))
    scans = sensor.scans(1.5)
    period_s = 2 * 60 / sensor.device.model.parameters.scan
    assert len(scans) == pytest.approx(1.5 / period_s, rel=0.3) and sensor.is_seen(scans[-1])
    assert scans[0].sweep.period_s == pytest.approx(period_s)
    assert {command, "BM"} <= set(sensor.device.heard) and sensor.device.state == "single"


def test_a_slow_line_carries_only_what_is_asked_for():
    """19200 baud: a short scan takes 0.7 s, and nobody takes that for silence."""
    sensor, waiting = Sensor("URG-04LX", ScipSettings(polled=True, short=True)), bytearray()

    def slow(said: bytes) -> bytes:
        waiting.extend(said)
        out = bytes(waiting[:10])  # in 5 ms
        del waiting[:10]
        return out

    scans = sensor.scans(10.0, line=slow)
    assert 10 <= len(scans) <= 14 and all(sensor.is_seen(scan) for scan in scans)
    assert len(waiting) < 1500 and sensor.device.heard.count("QT") == 2


def test_a_sensor_that_knows_only_scip_1_1():
    sensor = Sensor("URG-04LX")
    sensor.device.refuse["SC"] = "E"
    scans = sensor.scans(2.0)
    assert sensor.is_seen(scans[-1]) and len(scans) > 10
    assert scans[0].device_time_s is None and scans[0].sweep.range_max_m == 4.094
    assert "SCIP 1.1" in sensor.session.note and "H0614967" in sensor.session.note
    sensor.device.receive(sensor.session.closing())
    assert not sensor.device.laser_on
    with pytest.raises(DeviceFault, match=r"SCIP 1.1 has no intensity"):
        Sensor.scans(_told(sensor, ScipSettings(intensity="required")), 2.0)


def _told(sensor: Sensor, settings_: ScipSettings) -> Sensor:
    sensor.settings = settings_
    sensor.connect()
    return sensor


def test_the_laser_is_off_in_the_end():
    sensor = Sensor()
    sensor.scans(0.3)
    assert sensor.device.laser_on
    sensor.device.receive(sensor.session.closing())
    assert not sensor.device.laser_on and sensor.scans(0.3) == []


@pytest.mark.parametrize("before", [b"ME0000108001000\n", b"TM0\n", b"MD000", b"BM\n", b"%SL\n", b"\xff\x00MS"])
def test_whatever_the_last_host_left_behind(before):
    sensor = Sensor()
    sensor.device.receive(before)
    scans = sensor.scans(4.0)
    assert all(sensor.is_seen(scan) for scan in scans) and scans


def test_an_odd_reply_to_vv_does_no_harm():
    sensor = Sensor("URG-04LX")
    sensor.device.stray_line = True
    assert sensor.scans(0.5) and sensor.session.about["PROD"] == "SOKUIKI Sensor URG-04LX"
    assert sensor.session.note.startswith("SOKUIKI Sensor URG-04LX, without")


def test_odd_sums_of_the_state_do_no_harm():
    sensor = Sensor("UTM-30LX")
    sensor.device.remarks_unsummed = True
    assert sensor.scans(0.5) and sensor.session.about["SCSP"] == "Initial(2400[rpm])<-Default setting by user"


def test_a_slower_motor_makes_longer_sweeps():
    sensor = Sensor("URG-04LX-UG01")
    sensor.device.motor_speed = 500
    scans = sensor.scans(2.0)
    assert scans[0].sweep.period_s == pytest.approx(0.12)
    np.testing.assert_allclose(np.diff([scan.device_time_s for scan in scans]), 0.12, atol=0.0011)


def test_the_clock_of_the_sensor_begins_again():
    sensor = Sensor("UTM-30LX-EW")
    sensor.device.clock_ahead_ms = STAMP_TURN_MS - 400
    times = [scan.device_time_s for scan in sensor.scans(1.0)]
    assert times[0] < STAMP_TURN_MS / 1000 < times[-1]
    np.testing.assert_allclose(np.diff(times), 0.025, atol=0.0011)


@pytest.mark.parametrize("fault", ["stall", "power_cycle"])
@pytest.mark.parametrize("model", ["URG-04LX", "UST-20LX"])
def test_scans_that_stop_are_started_again(model, fault):
    sensor = Sensor(model)
    before = sensor.scans(1.0)
    getattr(sensor.device, fault)()
    after = sensor.scans(5.0)
    assert all(sensor.is_seen(scan) for scan in after) and len(after) > 10
    assert after[-1].device_time_s - before[-1].device_time_s == pytest.approx(5.0, abs=0.3)
    assert after[-1].sweep is before[-1].sweep


def test_a_sensor_that_answers_but_does_not_measure():
    sensor = Sensor()
    sensor.device.lose_next = 10_000
    with pytest.raises(DeviceFault, match="answers but sends no scans; its state: sensor is working normally"):
        sensor.scans(20.0)


def test_a_sensor_that_says_nothing():
    sensor = Sensor()
    sensor.device.silent = True
    with pytest.raises(DeviceFault, match="no answer to QT, in no version of SCIP"):
        sensor.scans(10.0)
    sensor = Sensor()
    assert sensor.scans(0.5)
    sensor.device.silent = True
    with pytest.raises(DeviceFault, match="no answer to QT"):
        sensor.scans(20.0)


@pytest.mark.parametrize(
    ("refuse", "why"),
    [
        ({"QT": "0I"}, "QT: status 0I waits for new firmware"),
        ({"QT": "0L"}, "does not become quiet"),
        ({"PP": "0E"}, "PP: status 0E undefined command; its state: sensor is working"),
        ({"PP": "0L"}, "PP: status 0L abnormal state; its state: sensor is working"),
        ({"MD": "04", "ME": "04"}, "MD: status 04 last step is out of range; its state: sensor is working"),
        ({"MD": "0M", "ME": "0M"}, "answers but sends no scans"),
        ({"ME": "52"}, "ME: status 52 hardware fault"),
    ],
)
def test_refusals_say_why(refuse, why):
    sensor = Sensor()
    sensor.device.refuse |= refuse
    with pytest.raises(DeviceFault, match=why):
        sensor.scans(15.0)


def test_a_laser_that_fails_while_it_measures_and_afterwards():
    sensor = Sensor("UTM-30LX")
    sensor.scans(0.5)
    sensor.device.broken = "51"
    with pytest.raises(DeviceFault, match=r"ME: status 51 hardware fault; its state: Laser trouble."):
        sensor.scans(1.0)
    for settings_, why in [
        (ScipSettings(), "ME: status 51 hardware fault; its state: Laser trouble."),
        (ScipSettings(polled=True), "BM: status 01 the laser does not work; its state: Laser trouble."),
    ]:
        with pytest.raises(DeviceFault, match=why):
            _told(sensor, settings_).scans(1.0)


def test_angles_that_the_sensor_does_not_see():
    with pytest.raises(DeviceFault, match=r"does not measure between the angles 2.5 and 3 rad"):
        Sensor("URG-04LX-UG01", ScipSettings(angle_min=2.5, angle_max=3)).scans(0.5)


@pytest.mark.parametrize(
    "wrong", [{"cluster": 0}, {"skip": 10}, {"short": True, "intensity": "required"}, {"angle_min": 1, "angle_max": 1}]
)
def test_settings_that_cannot_be(wrong):
    with pytest.raises(ValueError, match=r"must be|without intensity"):
        ScipSettings(**wrong)


@pytest.mark.parametrize("fault", ["garble_next", "cut_next", "lose_next"])
def test_damaged_scans_are_left_out_and_nothing_else(fault):
    sensor = Sensor("UTM-30LX")
    sensor.scans(0.5)
    setattr(sensor.device, fault, 3)
    scans = sensor.scans(1.0)
    # a scan that lost its end may take the next one's command with it
    assert 40 - 3 - 1 <= len(scans) <= 40 - 3 + 1 and all(sensor.is_seen(scan) for scan in scans)
    assert sensor.device.heard.count("ME0000108001000") == 1


@settings(max_examples=30)
@given(
    st.sampled_from(sorted(MODELS)),
    st.lists(
        st.one_of(
            st.binary(max_size=80),
            st.sampled_from([b"SCIP2.0\n", b"BM\n", b"TM0\n", b"TM1\n", b"RB\n", b"RS\n", b"GS0100011000\n", b"%ST\n"]),
            st.builds(
                lambda head, tail: head + tail + b"\n",
                st.sampled_from([b"MD", b"GE", b"MS00000100", b"SS", b"TM", b"G", b"QT;", b"HS"]),
                st.text(st.sampled_from("0123456789 ;\u00b9A"), max_size=20).map(lambda text: text.encode("latin-1")),
            ),
        ),
        max_size=12,
    ),
)
def test_the_emulator_hears_anything(model, said):
    sensor = Sensor(model)
    sensor.device.model = dataclasses.replace(sensor.device.model, dies_of_intensity=False)
    for data in said:
        sensor.clock.now += 0.05
        sensor.device.receive(data)
        sensor.device.tick()
    assert len(sensor.scans(4.0, step_s=0.05)) > 5


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 40),
            st.integers(0, 8000),
            st.sampled_from(["flip", "drop", "insert"]),
            st.integers(1, 255),
        ),
        max_size=12,
        unique_by=lambda harm: harm[0],  # two errors in one answer may cancel out in its sum
    )
)
def test_a_disturbed_line_gives_true_scans_or_none(harm):
    sensor = Sensor("URG-04LX")

    def is_true(scan):
        # a model that could not be understood, three times, has codes that nobody knows
        return len(scan.ranges) == 682 and bool(np.all(np.isnan(scan.ranges) | np.isclose(scan.ranges, sensor.seen[0])))

    try:
        assert all(is_true(scan) for scan in sensor.scans(6.0, step_s=0.02, line=DisturbedLine(harm)))
    except DeviceFault:
        return  # enough in a row that the link has to connect anew
    later = sensor.scans(6.0, step_s=0.02)
    assert all(is_true(scan) for scan in later) and len(later) > 20


def test_a_model_that_a_disturbed_line_hides_is_asked_for_again():
    sensor, heard = Sensor("UTM-30LX"), []

    def disturbed(said: bytes) -> bytes:
        heard.append(said)
        return said.replace(b"MODL:UTM", b"MODL:UTN") if said.startswith(b"PP") and len(heard) < 5 else said

    scans = sensor.scans(1.0, line=disturbed)
    assert scans[0].intensities is not None and sensor.is_seen(scans[0])
    assert 2 <= sensor.device.heard.count("PP") <= 3
