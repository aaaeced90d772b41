"""Laws of the simulated shelf board: statics, electronics, hands, tags; and that the household obeys them."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.simulation.board import LABORATORY_CELLS, BoardParameters, BoardWorld, Recording
from tms_agents.simulation.board_hands import HandParameters, Hands
from tms_agents.simulation.board_life import Household, LifeParameters
from tms_agents.simulation.board_noise import CellParameters
from tms_agents.simulation.board_plate import load_shares
from tms_agents.simulation.board_tags import TagParameters, ZoneBox
from tms_agents.simulation.world import Impossible

#: Nothing wrong with the electronics but the noise that dithers the counts.
IDEAL: dict[str, Any] = {
    "noise_sd_g": 0.0,
    "gain_sd": 0.0,
    "offset_sd_g": 0.0,
    "gain_error_sd": 0.0,
    "creep_per_hour": 0.0,
    "drift_g": 0.0,
    "daily_swing_g": 0.0,
    "vibration_g": 0.0,
}
ON_BOARD = st.tuples(st.floats(0.0, 0.465), st.floats(0.0, 0.317))


def board(seed: int = 0, *, tags: TagParameters | None = None, **electronics: Any) -> BoardWorld:
    parameters = BoardParameters(electronics=CellParameters(**(IDEAL | electronics)), tags=tags or TagParameters())
    return BoardWorld(parameters, np.random.default_rng(seed))


def moments_of(weight: float, xy: Any) -> Any:
    x, y = xy
    return weight * np.array([1, x, y, x * y])


# statics


@given(st.lists(st.tuples(ON_BOARD, st.floats(1, 2000)), min_size=1, max_size=5), st.integers(0, 1000))
def test_the_cells_carry_the_weight_and_their_centre_of_gravity_is_its_place(
    loads: list[tuple[tuple[float, float], float]], seed: int
) -> None:
    stiffness = np.random.default_rng(seed).uniform(0.5, 2.0, 4)
    moments = sum(moments_of(w, xy) for xy, w in loads)
    for torsion in (np.inf, 1.0, 0.0):
        on_cells = load_shares(LABORATORY_CELLS, list(stiffness), torsion) @ moments
        assert on_cells.sum() == pytest.approx(moments[0], abs=1e-6)
        assert on_cells @ np.array(LABORATORY_CELLS) == pytest.approx(moments[1:3], abs=1e-6)


def test_in_the_middle_equal_springs_share_equally_and_a_corner_load_relieves_the_far_corner() -> None:
    shares = load_shares(LABORATORY_CELLS)
    middle = np.mean(LABORATORY_CELLS, axis=0)
    assert shares @ moments_of(1000, middle) == pytest.approx([250] * 4)
    assert shares @ moments_of(1000, LABORATORY_CELLS[0]) == pytest.approx([750, 250, 250, -250])


def test_a_board_that_twists_freely_gives_all_to_the_corner_and_a_stiff_one_is_like_a_rigid_one() -> None:
    corner = moments_of(1000, LABORATORY_CELLS[0])
    assert load_shares(LABORATORY_CELLS, torsion=0.0) @ corner == pytest.approx([1000, 0, 0, 0], abs=1e-6)
    rigid, stiff, half = (load_shares(LABORATORY_CELLS, torsion=t) @ corner for t in (np.inf, 1e9, 1.0))
    assert stiff == pytest.approx(rigid, abs=1e-3)
    assert half == pytest.approx([875, 125, 125, -125])


@pytest.mark.parametrize("cells", [[(0, 0), (1, 0)], [(0, 0), (1, 1), (2, 2), (3, 3)], [(0, 0), (0, 0), (1, 0)]])
def test_a_board_on_a_line_of_cells_is_refused(cells: list[tuple[float, float]]) -> None:
    with pytest.raises(ValueError, match="cells"):
        load_shares(cells)


# electronics


@given(ON_BOARD, st.floats(25, 2000))
@settings(max_examples=30)
def test_a_perfect_board_reads_whole_counts_within_half_a_count_of_the_load(
    xy: tuple[float, float], weight: float
) -> None:
    world = board()
    world.stand("cup", weight, xy)
    counts = world.run(0.1).counts
    assert np.array_equal(counts, np.round(counts))
    assert np.abs(counts * 5 - world.loads(np.zeros(1))).max() <= 2.5 + 1e-9
    assert world.grams(counts) == pytest.approx(counts * 5)


def test_noise_has_the_stated_deviation_and_twice_as_much_with_the_antenna_on() -> None:
    tags = TagParameters(period_s=100.0, on_s=50.0)
    recording = board(1, noise_sd_g=8.0, tags=tags).run(100.0)
    grams = recording.counts * 5
    on = recording.t % 100 < 50
    assert grams[~on].std() == pytest.approx(np.hypot(8.0, 5 / np.sqrt(12)), rel=0.03)
    assert grams[on].std() == pytest.approx(np.hypot(16.0, 5 / np.sqrt(12)), rel=0.03)
    assert np.abs(np.corrcoef(grams[~on].T) - np.eye(4)).max() < 0.1


def test_calibration_takes_gains_and_offsets_out() -> None:
    world = board(2, gain_sd=0.02, offset_sd_g=300.0, noise_sd_g=2.0)
    world.stand("box", 1500.0, (0.1, 0.2))
    raw = world.run(20.0).counts
    assert np.abs(raw.mean(axis=0) * 5 - world.loads(np.zeros(1))[0]).max() > 50
    assert world.grams(raw).mean(axis=0) == pytest.approx(world.loads(np.zeros(1))[0], abs=0.5)


def test_a_load_creeps_by_its_share_in_an_hour() -> None:
    world = board(gram_per_count=0.01)
    world.stand("stone", 4000.0, (0.2, 0.15))
    start = world.run(0.02).counts.sum() * 0.01
    after = world.run(3600.0).counts.sum(axis=1) * 0.01
    assert start == pytest.approx(4000.0, abs=0.1)
    assert after[-1] == pytest.approx(4000.0, abs=0.1)
    creeping = board(gram_per_count=0.01, creep_per_hour=0.01)
    creeping.stand("stone", 4000.0, (0.2, 0.15))
    total = creeping.run(3600.0).counts.sum(axis=1) * 0.01
    assert total[-1] == pytest.approx(4040.0, abs=0.5)
    assert np.all(np.diff(total[::500]) > 0)


def test_the_zero_drifts_as_far_as_stated() -> None:
    ends = []
    for seed in range(30):
        drifting = BoardParameters(period_s=1.0, electronics=CellParameters(**(IDEAL | {"drift_g": 20.0})))
        ends.append(BoardWorld(drifting, np.random.default_rng(seed)).run(3600.0).counts[-1] * 5)
    assert np.std(ends) == pytest.approx(20.0, rel=0.2)


def test_vibration_comes_in_bursts_of_the_stated_band_and_size() -> None:
    parameters = BoardParameters(
        period_s=0.005,
        electronics=CellParameters(**(IDEAL | {"vibration_g": 20.0, "gram_per_count": 0.01})),
    )
    grams = BoardWorld(parameters, np.random.default_rng(5)).run(3000.0).counts[:, 0] * 0.01
    power = np.abs(np.fft.rfft(grams)) ** 2
    hz = np.fft.rfftfreq(len(grams), 0.005)
    assert power[(hz > 9) & (hz < 51)].sum() / power[1:].sum() > 0.98
    seconds = np.abs(grams).reshape(-1, 200).max(axis=1)
    assert 0.1 < np.mean(seconds > 1) < 0.5
    assert 10 < np.percentile(seconds[seconds > 1], 90) <= 20 * np.sqrt(3)


def test_a_stuck_cell_repeats_itself_until_repaired() -> None:
    world = board(3, noise_sd_g=8.0)
    last = world.run(1.0).counts[-1]
    world.electronics.stick(2)
    world.stand("box", 800.0, (0.2, 0.15))
    counts = world.run(1.0).counts
    assert np.all(counts[:, 2] == last[2])
    assert np.all(np.std(counts[:, [0, 1, 3]], axis=0) > 0)
    world.electronics.repair(2)
    assert np.std(world.run(1.0).counts[:, 2]) > 0


def test_overload_and_power_off_say_nothing() -> None:
    world = board(4, capacity_g=1000.0, power_on_sd_g=50.0)
    before = world.run(1.0).counts
    world.stand("anvil", 1800.0, LABORATORY_CELLS[0])
    assert np.isnan(world.run(1.0).counts[-1]).tolist() == [True, False, False, False]
    world.electronics.power(False)
    assert np.all(np.isnan(world.run(1.0).counts))
    world.electronics.power(True)
    after = world.run(1.0).counts
    assert np.all(np.isfinite(after[:, 1:]))
    assert np.abs(after - before)[:, 1:].max() > 2


# hands


@given(st.integers(0, 2**32), st.floats(25, 2000), ON_BOARD, ON_BOARD, st.booleans())
@settings(max_examples=60)
def test_hands_begin_and_end_with_the_weight_they_must(
    seed: int, weight: float, old: tuple[float, float], new: tuple[float, float], slow: bool
) -> None:
    hands = Hands(HandParameters(), np.random.default_rng(seed))
    put = hands.put(10.0, weight, new, hands.seconds(slow))
    take = hands.take(10.0, weight, old, hands.seconds(slow))
    lifted, off = hands.lift_and_put(10.0, weight, old, new, slow)
    slid = hands.slide(10.0, weight, old, new, slow)
    lean = hands.lean(10.0, old, None, None)
    nothing = np.zeros(4)
    at_old, at_new = (moments_of(weight, xy) for xy in (old, new))
    for trace, first, last in [
        (put, nothing, at_new),
        (take, at_old, nothing),
        (lifted, at_old, at_new),
        (slid, at_old, at_new),
        (lean, nothing, nothing),
    ]:
        assert np.all(np.diff(trace.t) > 0)
        assert trace.force_g.min() >= 0
        moments = trace.moments(np.array([9.0, trace.end + 1]))
        assert moments[0] == pytest.approx(first)
        assert moments[1] == pytest.approx(last, abs=1e-6)
    assert lifted.moments(np.array([off + 0.1]))[0] == pytest.approx(nothing, abs=1e-6)
    assert (put.end - 10.0 > 2.0) == slow
    assert slow or put.end - 10.0 < 1.5


def test_three_changes_in_ten_are_slow_and_hands_press_more_than_the_weight() -> None:
    hands = Hands(HandParameters(), np.random.default_rng(6))
    assert np.mean([hands.seconds(None) >= 2 for _ in range(2000)]) == pytest.approx(0.3, abs=0.04)
    puts = [hands.put(0.0, 300.0, (0.1, 0.1), 1.0) for _ in range(200)]
    assert np.mean([put.force_g.max() > 310.0 for put in puts]) > 0.5


# tags


def test_tags_are_missed_and_read_astray_at_the_stated_rates() -> None:
    left = ZoneBox("left", high=(0.2, 1.0))
    right = ZoneBox("right", low=(0.2, -1.0))
    tags = TagParameters(zones=(left, right), strangers=("NEIGHBOUR",), period_s=0.1, on_s=0.05)
    world = board(7, tags=tags)
    world.stand("a", 100.0, (0.1, 0.1), "A")
    world.stand("b", 100.0, (0.3, 0.1), "B")
    rounds = world.run(1000.0).rounds
    assert len(rounds) == 10_000
    for zone, inside in (("left", "A"), ("right", "B")):
        mine = [one.tags for one in rounds if one.zone == zone]
        assert len(mine) == 5000
        assert np.mean([inside not in tags for tags in mine]) == pytest.approx(0.05, abs=0.012)
        assert np.mean([bool(tags - {inside}) for tags in mine]) == pytest.approx(0.01, abs=0.006)


def test_a_tag_is_in_the_field_from_before_the_weight_until_after_it() -> None:
    world = board(8, tags=TagParameters(miss_rate=0, stray_rate=0))
    put = world.place("cup", 200.0, (0.1, 0.1), "CUP")
    while world.time_s < put.start:
        world.step(0.02)
        assert world.tags_in_zone("board") == {"CUP"}
    world.run(10.0)
    out = world.take("cup")
    while world.time_s < out.stable:
        assert world.tags_in_zone("board") == {"CUP"}
        world.step(0.02)
    world.run(1.0)
    assert world.tags_in_zone("board") == frozenset()


# the world


def everything(seed: int) -> BoardWorld:
    return BoardWorld(BoardParameters(), np.random.default_rng(seed))


def test_the_same_seed_gives_the_same_world_however_time_is_cut() -> None:
    whole, cut, stepped, other = everything(9), everything(9), everything(9), everything(10)
    for world in (whole, cut, stepped, other):
        world.place("cup", 300.0, (0.1, 0.1), "CUP", after=1.0)
        world.lean((0.2, 0.0))
    recording = whole.run(200.0)
    pieces: list[Recording] = [cut.run(0.5) for _ in range(400)]
    assert np.array_equal(recording.counts, np.concatenate([one.counts for one in pieces]))
    assert recording.rounds == [one for piece in pieces for one in piece.rounds]
    assert not np.array_equal(recording.counts, other.run(200.0).counts)
    # Live, the antenna is the emulator's: silent where it was off in the recording too.
    live = []
    for _ in range(int(20 / 0.005)):
        stepped.rf_on = bool(stepped.reader.on_at(np.array([stepped.time_s + 0.02]))[0])
        stepped.step(0.005)
        live.append(stepped.cell_counts())
    assert np.array_equal(np.array(live[3::4]), recording.counts[:1000])


def test_what_is_impossible_is_refused_and_changes_nothing() -> None:
    world = everything(11)
    world.place("cup", 300.0, (0.1, 0.1))
    with pytest.raises(Impossible, match="already"):
        world.place("cup", 300.0, (0.2, 0.1))
    with pytest.raises(Impossible, match="hands"):
        world.take("cup")
    with pytest.raises(Impossible, match="does not stand"):
        world.move("pot", (0.2, 0.1))
    world.run(10.0)
    world.take("cup")
    assert len(world.truth) == 2


@given(st.integers(0, 2**32))
@settings(max_examples=8)
def test_a_household_leaves_on_the_board_what_its_changes_say(seed: int) -> None:
    parameters = replace(BoardParameters(), electronics=CellParameters(**IDEAL))
    world = BoardWorld(parameters, np.random.default_rng(seed))
    household = Household(world, LifeParameters(lean_share=0.1), np.random.default_rng(seed + 1))
    there: dict[str, tuple[float, tuple[float, float]]] = {}
    end = 0.0
    for episode in household.live(30):
        assert episode.recording.t[0] == pytest.approx(end + 0.02)
        end = float(episode.recording.t[-1])
        for change in episode.changes:
            assert change.start < change.stable < end
            if change.kind == "out":
                del there[change.name]
            elif change.kind != "lean":
                assert (change.kind == "in") == (change.name not in there)
                there[change.name] = (change.weight_g, change.xy)
        moments = sum((moments_of(w, xy) for w, xy in there.values()), np.zeros(4))
        assert np.abs(episode.recording.counts[-1] * 5 - world.shares @ moments).max() <= 2.5 + 1e-6


# the yardstick of the cabinet benchmark


def laboratory() -> ModuleType:
    path = Path(__file__).resolve().parents[2] / "benchmarks" / "laboratory.py"
    spec = importlib.util.spec_from_file_location("laboratory", path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["laboratory"] = module
    spec.loader.exec_module(module)
    return module


def told_by(cabinet: Any, world: BoardWorld, seconds: float) -> list[Any]:
    recording = world.run(seconds)
    rounds = list(recording.rounds)
    told = []
    for t, grams in zip(recording.t, world.grams(recording.counts), strict=True):
        while rounds and rounds[0].t <= t:
            cabinet.inventory(rounds.pop(0).tags)
        told += cabinet.load(float(t), grams)
    return told


def test_the_laboratorys_algorithm_sees_in_move_and_out_in_an_easy_world() -> None:
    parameters = BoardParameters(
        torsion=0.0,
        electronics=CellParameters(**(IDEAL | {"noise_sd_g": 2.0})),
        hands=HandParameters(slow_share=0, quick_s=(0.1, 0.15), press_share=0, press_g=0, approach_s=(0.8, 1.2)),
        tags=TagParameters(miss_rate=0, stray_rate=0),
    )
    world = BoardWorld(parameters, np.random.default_rng(12))
    cabinet = laboratory().LaboratoryCabinet(parameters.cells)
    assert told_by(cabinet, world, 3.0) == []
    for i, xy in enumerate([(0.1, 0.1), (0.35, 0.2), (0.2, 0.25)]):
        world.place(f"thing{i}", 300.0 + 200 * i, xy, f"TAG{i}")
        (told,) = told_by(cabinet, world, 6.0)
        assert (told.kind, told.tag) == ("in", f"TAG{i}")
        assert told.xy == pytest.approx(xy, abs=0.02)
        assert told.weight_g == pytest.approx(300 + 200 * i, abs=10)
    world.move("thing1", (0.1, 0.22))
    (told,) = told_by(cabinet, world, 8.0)
    assert (told.kind, told.tag) == ("move", "TAG1")
    assert told.xy == pytest.approx((0.1, 0.22), abs=0.02)
    world.take("thing2")
    (told,) = told_by(cabinet, world, 6.0)
    assert (told.kind, told.tag) == ("out", "TAG2")


def test_the_laboratorys_algorithm_keeps_its_published_defects() -> None:
    cabinet = laboratory().LaboratoryCabinet(LABORATORY_CELLS)
    load = np.zeros(4)

    def stand_still(t: float, added: Any = 0.0) -> list[Any]:
        nonlocal load
        load = load + added
        return [told for i in range(11) for told in cabinet.load(t + 0.02 * i, load)]

    stand_still(0.0)
    # Signs are lost: what a rigid board's corner load does to the far cell pulls the position towards it.
    cabinet.inventory(frozenset({"A"}))
    (told,) = stand_still(1.0, np.array([750.0, 250.0, 250.0, -250.0]))
    assert told.kind == "in"
    assert told.xy[0] > 0.2
    # Of two tags that come in one cycle, the second is never noticed; one missed read is an exit.
    cabinet.inventory(frozenset({"A", "B", "C"}))
    (told,) = stand_still(2.0, np.full(4, 100.0))
    assert told.tag == "B"
    assert stand_still(3.0, np.full(4, 100.0)) == []
    cabinet.inventory(frozenset({"B", "C"}))
    (told,) = stand_still(4.0)
    assert (told.kind, told.tag) == ("out", "A")
    # An untagged thing is ignored, a load that never stands still is waited for without end.
    assert stand_still(5.0, np.full(4, 100.0)) == []
    shaken = [told for i in range(200) for told in cabinet.load(6.0 + i, load + 40.0 * (-1) ** i)]
    assert shaken == []
