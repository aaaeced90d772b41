"""What every wire model shares: strict shape, finite numbers, UTC times, and the identifier types."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, Field, StringConstraints, WithJsonSchema


class Model(BaseModel):
    """Base of all wire models: unknown fields and non-finite numbers are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, populate_by_name=True)


def _to_utc(value: datetime) -> datetime:
    if not value.utcoffset():
        return value.replace(tzinfo=UTC)  # nearly always, and cheaper
    try:
        return value.astimezone(UTC)
    except OverflowError:
        raise ValueError("the time is outside the years 1 to 9999 in UTC") from None


#: RFC 3339 time with an offset; held, stored and sent as UTC.
UtcTime = Annotated[AwareDatetime, AfterValidator(_to_utc)]

#: EPC hex or ISO 15693 UID of a tag; the primary key of an object. Upper-cased.
Tag = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9._:-]{1,64}$", to_upper=True)]
RoomId = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
AgentId = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
#: In scenario files any name; on the wire ``agent/n`` (checked by the batch, which knows the agent).
LabelId = Annotated[str, StringConstraints(min_length=1, max_length=129, pattern=r"^[^\x00-\x1f]+$")]
#: JAN / EAN / GTIN digits; the server verifies the check digit.
Jan = Annotated[str, StringConstraints(pattern=r"^([0-9]{8}|[0-9]{12,14})$")]
Name = Annotated[str, StringConstraints(min_length=1, max_length=200, strip_whitespace=True, pattern=r"^[^\x00]+$")]


def numbers(count: int, **bounds: float) -> WithJsonSchema:
    """How a tuple of numbers is published: as an array, which every generator of clients and tests can read."""
    return WithJsonSchema({"type": "array", "items": {"type": "number"} | bounds, "minItems": count, "maxItems": count})


#: Metres in the room frame. The bound keeps squared distances finite.
Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
Xy = Annotated[tuple[Metres, Metres], numbers(2, minimum=-1e6, maximum=1e6)]
#: (x, y, theta): metres, radians counter-clockwise.
Pose = Annotated[tuple[Metres, Metres, Annotated[float, Field(ge=-1e3, le=1e3)]], numbers(3, minimum=-1e6, maximum=1e6)]
Polygon = Annotated[list[Xy], Field(min_length=3, max_length=1000)]
Grams = Annotated[float, Field(ge=0, le=1e7)]
Probability = Annotated[float, Field(ge=0, le=1)]
