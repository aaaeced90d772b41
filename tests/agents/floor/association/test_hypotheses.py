"""What is found of the best hypothesis holds in the others, where they are about the same people."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.floor.association.association import Association
from tms_agents.floor.state import BODY, PRINT, empty

_KEPT, _BODIES = 4, 6


def _association() -> tuple[Association, Any]:
    """Four hypotheses about three people; all differ in where the second is, the last one in where the first is."""
    association = Association(_BODIES, 1)
    hypotheses = association._now.bodies
    for h in range(_KEPT):
        for b in range(3):
            body = hypotheses[h, b]
            body["used"], body["confirmed"], body["label"], body["x"] = 1, 1, b + 1, float(b)
            body["look_n"] = 10 * h
    hypotheses["x"][:_KEPT, 1] = np.arange(_KEPT)
    hypotheses["x"][3, 0] = 7.0
    association._count = _KEPT
    association._scores[:_KEPT] = association._now.nobodys_at[:_KEPT, 0] = np.arange(_KEPT)
    return association, hypotheses


def test_what_is_found_of_somebody_is_so_wherever_he_is_the_same() -> None:
    association, hypotheses = _association()
    association.mark()
    association.bodies["stale"][0], association.bodies["stale"][1] = 1, 1
    association.settle()
    assert association._count == _KEPT
    assert hypotheses["stale"][:_KEPT, 0].tolist() == [1, 1, 1, 0]
    assert hypotheses["stale"][:_KEPT, 1].tolist() == [1, 0, 0, 0]


def test_who_is_put_on_a_print_stands_there_in_all_of_them() -> None:
    association, hypotheses = _association()
    hypotheses["shine"][:, 3] = np.arange(len(hypotheses))
    prints = empty(PRINT, 1)
    prints["used"], prints["x"], prints["owner"] = 1, 4.0, -1
    association.mark()
    index = association.stand(prints, 0, 9.0)
    association.bodies["confirmed"][index], association.bodies["label"][index] = 1, 8
    association.named(index, (4.0, 0.0))
    association.settle()
    assert association._count == _KEPT
    assert all(hypotheses[h, index] == hypotheses[0, index] for h in range(_KEPT))
    assert (index, hypotheses["label"][1, index], hypotheses["x"][1, index]) == (3, 8, 4.0)


def test_how_somebody_looked_since_the_last_doubt_is_a_matter_of_the_doubt() -> None:
    association, hypotheses = _association()
    association.mark()
    association.bodies["stale"][0], association.bodies["look_n"][0] = 1, 99
    association.settle()
    assert hypotheses["look_n"][:_KEPT, 0].tolist() == [99, 10, 20, 30]


def test_where_he_is_another_one_counts_no_more_once_it_is_decided() -> None:
    association, hypotheses = _association()
    association.mark()
    association.bodies["label"][0] = 12
    association.decide(0)
    association.settle()
    assert association._count == 3
    assert hypotheses["label"][:3, 0].tolist() == [12, 12, 12]
    assert hypotheses["x"][:3, 1].tolist() == association._now.nobodys_at[:3, 0].tolist() == [0.0, 1.0, 2.0]
    association.mark()
    association.bodies["x"][1] = 0.5
    association.decide_changed()
    association.settle()
    assert association._count == 1


@settings(max_examples=60)
@given(
    changed=st.lists(st.integers(0, 2), max_size=3),
    decided=st.lists(st.integers(0, 2), max_size=3),
    seed=st.integers(0),
)
def test_the_best_stays_what_it_is_and_the_order_is_kept(changed: list[int], decided: list[int], seed: int) -> None:
    association, hypotheses = _association()
    rng = np.random.default_rng(seed)
    association.mark()
    for index in changed:
        association.bodies["lone"][index] = rng.uniform()
        association.bodies["x"][index] = rng.uniform()
    association.decide(*decided)
    best = association.bodies.copy()
    association.settle()
    np.testing.assert_array_equal(association.bodies, best)
    scores = association._scores[: association._count].tolist()
    assert scores == sorted(scores) == association._now.nobodys_at[: association._count, 0].tolist()
    assert association._count == (1 if 1 in decided else 3 if 0 in decided else 4)
    assert hypotheses.dtype == BODY
