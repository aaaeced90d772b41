"""Replaying a scenario file: the belief after every event, in the format of ``tms placement replay``."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, Literal, get_args

from tms_schemas.scenario import Scenario
from tms_server.placement.engine import Engine
from tms_server.placement.paper import PaperFilter
from tms_server.placement.parameters import PAPER, Parameters
from tms_server.placement.specs import DrawKey, InvalidEvent, LabelSpec, ObjectSpec

Filter = Literal["paper", "exact", "particle"]
Variant = Literal["full", "paper"]
FILTERS: tuple[Filter, ...] = get_args(Filter)
VARIANTS: tuple[Variant, ...] = get_args(Variant)

#: Budget of the particle filter and individuals of the paper's, where the caller names none.
DEFAULT_PARTICLES: dict[Filter, int] = {"particle": 1000, "paper": 10_000}


def scenario_parameters(scenario: Scenario, variant: Variant) -> Parameters:
    """Defaults < the scenario's ``params`` < the PAPER set (variant paper) < its ``variant_overrides`` (rule 1)."""
    return Parameters.of(
        scenario.params, PAPER if variant == "paper" else {}, scenario.variant_overrides.get(variant, {})
    )


def scenario_filter(
    scenario: Scenario, name: Filter, variant: Variant = "full", particles: int | None = None, seed: int = 0
) -> Engine | PaperFilter:
    """The filter at the scenario's start. ValueError where the scenario contradicts itself."""
    objects = [
        ObjectSpec(
            id=str(o.id),
            tag=o.tag,
            weight_g=o.weight_g,
            weight_sd_g=o.weight_sd_g,
            size_m=o.size_m,
            p_read=o.p_read,
        )
        for o in scenario.objects
    ]
    labels = [LabelSpec(id=label.id, kind=label.kind, xy=label.xy) for label in scenario.labels]
    initial = scenario.initial.model_dump()
    parameters = scenario_parameters(scenario, variant)
    if name == "exact":
        return Engine(objects, labels, initial, parameters, budget=None)
    count = DEFAULT_PARTICLES[name] if particles is None else particles
    if name == "particle":
        return Engine(objects, labels, initial, parameters, budget=count)
    return PaperFilter(objects, labels, initial, parameters, individuals=count, seed=seed)


def replay(
    scenario: Scenario,
    name: Filter,
    variant: Variant = "full",
    particles: int | None = None,
    seed: int = 0,
    progress: Callable[[int], None] = lambda done: None,
) -> dict[str, Any]:
    """Fold the scenario; ``{"scenario", "filter", "variant", "steps"}`` with one step per event and -1 for the start.

    ``seconds`` of a step: time for the event and the marginals of the objects it concerns.

    Raises:
        InvalidEvent: naming the index of the event.
        ValueError: the scenario contradicts itself.
    """
    belief = scenario_filter(scenario, name, variant, particles, seed)
    marginals = belief.marginals()
    steps = [_step(-1, marginals, 0.0, False, 0.0)]
    for i, event in enumerate(scenario.events):
        began = time.perf_counter()
        try:
            info = belief.apply(event, DrawKey(seed, scenario.name, i))
        except InvalidEvent as error:
            raise InvalidEvent(f"event {i} ({event.type}): {error}") from error
        marginals = {**marginals, **{o: belief.marginal(o) for o in info.changed}}
        seconds = time.perf_counter() - began
        steps.append(_step(i, marginals, info.log_evidence, info.contradiction, seconds))
        progress(i + 1)
    return {"scenario": scenario.name, "filter": name, "variant": variant, "steps": steps}


def _step(
    event: int,
    marginals: dict[str, dict[str, float]],
    log_evidence: float,
    contradiction: bool,
    seconds: float,
) -> dict[str, Any]:
    return {
        "event": event,
        "marginals": marginals,
        # The paper's filter computes no evidence.
        "log_evidence": None if math.isnan(log_evidence) else log_evidence,
        "contradiction": contradiction,
        "seconds": seconds,
    }
