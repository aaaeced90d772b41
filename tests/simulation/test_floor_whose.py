"""The fit of the costs of feet: all explanations of a scan are added up, and the right ones made likely."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def whose() -> Iterator[Any]:
    sys.path.insert(0, str(BENCHMARKS))
    import floor_whose

    yield floor_whose
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture(scope="module")
def noted(whose: Any) -> list[Any]:
    """What half a minute of three who pass each other gives."""
    from floor_told import Job

    return whose.situations(Job("three close", 1, "legs", "coarse"), 35.0)


@pytest.mark.parametrize("seed", range(4))
def test_all_explanations_are_added_up_once(whose: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    people, clusters = int(rng.integers(1, 4)), int(rng.integers(1, 5))
    cost, nobodys = rng.uniform(0.0, 6.0, (clusters, 2 * people)), rng.uniform(0.0, 6.0, clusters)
    missed, allowed = rng.uniform(0.0, 2.0, people), rng.random((clusters, people + 1)) < 0.7
    total = 0.0
    for columns in product(range(2 * people + 1), repeat=clusters):
        feet = [column for column in columns if column < 2 * people]
        if len(set(feet)) == len(feet) and all(allowed[i, column // 2] for i, column in enumerate(columns)):
            price = sum(cost[i, j] if j < 2 * people else nobodys[i] for i, j in enumerate(columns))
            total += np.exp(-price - sum(missed[k] for k in range(people) if not {2 * k, 2 * k + 1} & set(feet)))
    taken = np.zeros(2 * people, np.bool_)
    assert whose._explained(0, cost, nobodys, missed, allowed, taken, 0.0) == pytest.approx(total)
    assert not taken.any()


def test_right_explanations_are_mostly_likely(whose: Any, noted: list[Any]) -> None:
    nats = whose.Data(noted).nats()
    assert len(noted) > 60 and (nats >= -1e-9).all()
    assert np.median(nats) < 0.05 and nats.mean() < 0.5
    # Legs that may be anywhere tell nothing.
    anywhere = whose.LEGS._replace(along_m=4.0, aside_m=4.0, seen=0.0, seen_m=9.0, ahead_m=4.0, ahead_aside_m=4.0)
    assert whose.Data(noted).nats(anywhere).mean() > 1.2 * nats.mean()
    # Nobody here shows shoes.
    assert whose.Data(noted).nats(whose.SHOES._replace(along_m=0.1)) == pytest.approx(nats)


def test_the_fit_makes_them_likelier_and_holds_what_it_should(whose: Any, noted: list[Any]) -> None:
    wrong = whose.LEGS._replace(both=0.5, strides=0.5, stolen=0.1)
    before = whose.Data(noted).nats().mean()
    fitted = whose.fit(noted, most=3)
    assert whose.Data(noted).nats(fitted).mean() < before < whose.Data(noted).nats(wrong).mean()
    assert all(getattr(fitted, name) == getattr(whose.LEGS, name) for name in whose.HELD)


def test_it_tells_how_likely_they_are(whose: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        whose.main(["--scenes", "four"])
    assert "no scene four" in capsys.readouterr().err
