"""The solver: exact data give back what made them, noisy data err as predicted, nonsense is refused by name."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.cabinet.calibration import CalibrationError, Measured, solve
from tms_agents.cabinet.calibration_file import BoardCalibration, read_calibration, write_calibration
from tms_client.cli import CommandError

WIDTH, DEPTH = 0.44, 0.30
CELLS = np.array([[0.04, 0.03], [0.40, 0.03], [0.04, 0.27], [0.40, 0.27]])
SPOTS = np.array([[0.08, 0.06], [0.36, 0.06], [0.08, 0.24], [0.36, 0.24], [0.22, 0.15]])
QUIET = np.zeros(4)


def stiff(xy) -> np.ndarray:
    """Shares of four equal springs under a rigid board: affine in the position, sum 1, right moment."""
    x, y = (np.asarray(xy) - CELLS.mean(axis=0)) / (np.ptp(CELLS, axis=0) / 2)
    sx, sy = np.array([-1, 1, -1, 1]), np.array([-1, -1, 1, 1])
    return (1 + sx * x + sy * y) / 4


def bending(xy) -> np.ndarray:
    """Shares under a board that bends: bilinear."""
    u, v = (np.asarray(xy) - CELLS[0]) / (CELLS[3] - CELLS[0])
    return np.array([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])


def measure(gain, offset, shares, weights=500.0, spots=SPOTS, noise=None) -> list[Measured]:
    weights = np.broadcast_to(weights, len(spots))
    counts = [shares(p) * w / gain + offset for p, w in zip(spots, weights, strict=True)]
    if noise is not None:
        counts = [one + noise(4) for one in counts]
    return [Measured(float(w), tuple(p), c) for p, w, c in zip(spots, weights, counts, strict=True)]


gains = st.lists(st.floats(0.5, 2.0), min_size=4, max_size=4).map(np.array)
offsets = st.lists(st.floats(-1e5, 1e5), min_size=4, max_size=4).map(np.array)
scales = st.sampled_from([5.0, -0.004, 1.0])


@given(gains, scales, offsets, st.floats(50, 5000), st.sampled_from([stiff, bending]))
@settings(max_examples=60)
def test_exact_data_give_gains_and_offsets(gain, scale, offset, weight, shares):
    gain = gain * scale
    found = solve(offset, QUIET, measure(gain, offset, shares, weight), CELLS)
    np.testing.assert_allclose(found.gain, gain, rtol=1e-5)
    np.testing.assert_allclose(found.grams(offset + 100 / gain), 100.0, rtol=1e-5)
    assert found.rmse_weight_g < 1e-4 * weight and found.rmse_position_m < 1e-5


@given(gains, offsets, st.floats(50, 5000))
@settings(max_examples=40)
def test_exact_data_of_a_bending_board_give_positions_too(gain, offset, weight):
    found = solve(offset, QUIET, measure(gain, offset, bending, weight), None)
    np.testing.assert_allclose(found.gain, gain, rtol=1e-4)
    np.testing.assert_allclose(found.cells, CELLS, atol=1e-5)


def test_errors_are_as_predicted():
    """Noise of the counts and of placing by hand: the gains miss by what ``gain_sd`` says."""
    random = np.random.default_rng(1)
    gain, offset, noise, samples, spot_sd = np.full(4, 5.0), np.full(4, 100.0), 1.6, 25, 0.003
    pulls = []
    for _ in range(300):
        real = SPOTS + random.normal(0, spot_sd, SPOTS.shape)
        measured = [
            Measured(500.0, tuple(said), stiff(p) * 500 / gain + offset + random.normal(0, noise / 5, 4))
            for said, p in zip(SPOTS, real, strict=True)
        ]
        empty = offset + random.normal(0, noise / 5, 4)
        found = solve(empty, np.full(4, noise), measured, CELLS, samples=samples, spot_sd_m=spot_sd)
        pulls.append((found.gain - gain) / found.gain_sd)
    assert 0.7 < np.std(pulls) < 1.5
    assert abs(np.mean(pulls)) < 0.3


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_a_heavier_weight_is_never_worse(seed):
    random = np.random.default_rng(seed)
    gain = random.uniform(3, 7, 4)
    noise = np.full(4, 2.0)
    light, heavy = (solve(np.zeros(4), noise, measure(gain, 0.0, stiff, w), CELLS) for w in (300.0, 3000.0))
    assert (heavy.gain_sd < light.gain_sd).all()


def test_one_scale_alone():
    found = solve(
        np.array([3.0]),
        np.array([0.1]),
        [Measured(500.0, (0.2, 0.1), np.array([253.0])), Measured(1000.0, (0.1, 0.1), np.array([503.0]))],
        np.array([[0.2, 0.15]]),
    )
    assert found.gain == pytest.approx([2.0])
    assert found.rmse_weight_g == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda m: m[:2], "2 spots are too few: at least 3"),
        (lambda m: [m[0]] * 5, "on one line"),
        (lambda m: m[:1] + m[4:] + m[3:4], "on one line"),
        (lambda m: [], "no spot"),
        (lambda m: [Measured(-5.0, one.xy, one.counts) for one in m], "more than 0 g"),
        (lambda m: [Measured(one.weight_g, one.xy, one.counts * [1, 1, 0, 1]) for one in m], "cell 2 does not respond"),
        (lambda m: [Measured(one.weight_g, one.xy, one.counts * [1, np.nan, 1, 1]) for one in m], "cell 1 gives no"),
        (lambda m: [Measured(one.weight_g, one.xy, one.counts * [-1, 1, 1, 1]) for one in m], "cell 0 has the gain"),
        (lambda m: [Measured(one.weight_g, one.xy, one.counts * [1, 1, 1, 9]) for one in m], "cell 3 has the gain"),
    ],
)
def test_nonsense_is_refused(change, says):
    with pytest.raises(CalibrationError, match=says):
        solve(np.zeros(4), np.full(4, 1.0), change(measure(np.full(4, 5.0), 0.0, stiff)), CELLS)


def test_positions_of_a_stiff_board_cannot_be_found():
    with pytest.raises(CalibrationError, match="do not determine all cells"):
        solve(np.zeros(4), QUIET, measure(np.full(4, 5.0), 0.0, stiff), None)


def test_a_file_keeps_what_was_measured(tmp_path):
    path = tmp_path / "cabinet.calibration.toml"
    gain = np.array([5.0, 4.9, -5.1, 1 / 3])
    solution = solve(np.full(4, 12.5), np.full(4, 0.5), measure(np.full(4, 5.0), 12.5, bending), None)
    board = BoardCalibration.of(solution, datetime(2026, 11, 21, tzinfo=UTC), with_cells=True)
    assert write_calibration(path, {"upper shelf": board}) is None
    assert read_calibration(path) == {"upper shelf": board}
    other = BoardCalibration(gain=list(gain), offset=[0.0] * 4)
    assert write_calibration(path, {"upper shelf": board, 'a "b"': other}) == tmp_path / f"{path.name}.old"
    assert read_calibration(path) == {"upper shelf": board, 'a "b"': other}
    assert read_calibration(tmp_path / f"{path.name}.old") == {"upper shelf": board}
    assert read_calibration(tmp_path / "none.toml") == {}
    assert sorted(one.name for one in tmp_path.iterdir()) == [path.name, f"{path.name}.old"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[a]\ngain = [1.0]\noffset = [0.0, 1.0]", "one value per cell"),
        ("[a]\ngain = [0.0]\noffset = [0.0]", "gain of 0"),
        ("[a]\ngian = [1.0]\noffset = [0.0]", "a.gain: Field required"),
        ("[a", "expected"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path, text, says):
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(CommandError) as caught:
        read_calibration(path)
    assert says in str(caught.value).lower() or says in str(caught.value)
