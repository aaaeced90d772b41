"""Scenario files: a room, its objects and an event sequence in one JSON document (format ``placement-events/1``)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from tms_schemas.base import Grams, LabelId, Model, Probability, Tag, Xy
from tms_schemas.events import AnyEvent, Kind

ObjectId = int | str


class _Lenient(Model):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False, populate_by_name=True)


class ScenarioObject(_Lenient):
    id: ObjectId
    tag: Tag | None = None
    weight_g: Grams | None = None
    weight_sd_g: Annotated[float, Field(ge=0)] = 0.0
    size_m: Annotated[float, Field(ge=0)] | None = None
    p_read: Probability | None = None


class ScenarioLabel(_Lenient):
    id: LabelId
    kind: Kind
    xy: Xy


class KnownStart(_Lenient):
    type: Literal["known"]
    placement: dict[str, str] = {}


class WeightedPlacement(_Lenient):
    p: Annotated[float, Field(gt=0)]
    placement: dict[str, str]


class ListStart(_Lenient):
    type: Literal["list"]
    hypotheses: Annotated[list[WeightedPlacement], Field(min_length=1)]


class UniformStart(_Lenient):
    type: Literal["uniform"]


class Scenario(_Lenient):
    """``params`` and ``variant_overrides`` stay plain mappings: the belief engine owns their meaning."""

    format: Literal["placement-events/1"]
    name: str
    description: str = ""
    params: dict[str, Any] = {}
    variant_overrides: dict[str, dict[str, Any]] = {}
    objects: list[ScenarioObject]
    labels: list[ScenarioLabel] = []
    initial: Annotated[KnownStart | ListStart | UniformStart, Field(discriminator="type")]
    events: list[AnyEvent]

    @model_validator(mode="after")
    def _unique_objects(self) -> Scenario:
        ids = [str(o.id) for o in self.objects]
        if len(set(ids)) != len(ids):
            raise ValueError("object ids are not unique")
        return self


def read_scenario(text: str | bytes) -> Scenario:
    """Parse a scenario; unknown extra fields are ignored everywhere.

    Raises:
        pydantic.ValidationError: the document is not a scenario.
    """
    return Scenario.model_validate_json(text, extra="ignore")
