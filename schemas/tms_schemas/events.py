"""The core event vocabulary shared by scenario files, the room log and the wire (placement-events/1).

An event says what changed at one instant. Labels are position labels; a *mover* label may hold any number of
objects, every other kind at most one. Scenario files are read with ``extra="ignore"``; the wire forbids unknown
fields and ``tick``.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from tms_schemas.base import Grams, LabelId, Metres, Model, Probability, Tag, Xy, numbers

ExclusiveKind = Literal["cabinet", "floor", "robot", "table"]
Kind = Literal["cabinet", "floor", "robot", "table", "mover"]
#: Covariance of (x, y) as (xx, xy, yy), m^2.
Covariance = Annotated[tuple[float, float, float], numbers(3)]


class Near(Model):
    """Another agent's mover, named by where it is: the server takes the nearest one at that time."""

    xy: Xy


#: A mover: by label where the label is the agent's own (or in a scenario), by position otherwise.
MoverRef = LabelId | Near


class Placed(Model):
    """Where a label is: the position, its uncertainty and the furniture surface under it, where known."""

    xy: Xy
    z: Metres | None = None
    cov: Covariance | None = None
    surface: str | None = Field(default=None, max_length=129, description="furniture/surface")


class LabelAppeared(Placed):
    type: Literal["label_appeared"] = "label_appeared"
    label: LabelId
    kind: ExclusiveKind
    # Three-valued: a tag was read, a reader is there and read nothing (null), no reader there (absent).
    tag: Tag | None = None
    weight_g: Grams | None = None
    size_m: Annotated[float, Field(ge=0, le=100)] | None = None
    source: MoverRef | None = None

    @property
    def reader_present(self) -> bool:
        """True where a reader covers the label, whether or not it read a tag."""
        return "tag" in self.model_fields_set


class LabelVanished(Model):
    type: Literal["label_vanished"] = "label_vanished"
    label: LabelId
    weight_g: Grams | None = None
    dest: MoverRef | None = None


class LabelMoved(Placed):
    type: Literal["label_moved"] = "label_moved"
    label: LabelId


class MoverEntered(Placed):
    type: Literal["mover_entered"] = "mover_entered"
    label: LabelId


class MoverLeft(Model):
    type: Literal["mover_left"] = "mover_left"
    label: LabelId


class TagObserved(Model):
    """One more independent read: of one label, or of a zone (``labels``)."""

    type: Literal["tag_observed"] = "tag_observed"
    label: LabelId | None = None
    labels: Annotated[list[LabelId], Field(min_length=1, max_length=1000)] | None = None
    tag: Tag

    @model_validator(mode="after")
    def _one_target(self) -> Self:
        if (self.label is None) == (self.labels is None):
            raise ValueError("give either label or labels")
        return self


class TagMissed(Model):
    """A reader reads nothing at ``label``, or the zone reader over ``labels`` does not see ``tag``."""

    type: Literal["tag_missed"] = "tag_missed"
    label: LabelId | None = None
    labels: Annotated[list[LabelId], Field(min_length=1, max_length=1000)] | None = None
    tag: Tag | None = None

    @model_validator(mode="after")
    def _one_target(self) -> Self:
        if (self.label is None) == (self.labels is None):
            raise ValueError("give either label or labels")
        if self.labels is not None and self.tag is None:
            raise ValueError("a zone miss names the tag that was not seen")
        return self


class Handover(Model):
    """Notice: exactly one object passed from one mover to another."""

    type: Literal["handover"] = "handover"
    from_: MoverRef = Field(alias="from")
    to: MoverRef
    tag: Tag | None = None


class HandoverPossible(Model):
    """Two movers met; a hidden hand-over is possible."""

    type: Literal["handover_possible"] = "handover_possible"
    a: MoverRef
    b: MoverRef
    p: Probability | None = None


class MoverSwap(Model):
    """The tracker may have exchanged the two movers' labels."""

    type: Literal["mover_swap"] = "mover_swap"
    a: LabelId
    b: LabelId
    p: Probability


class Transfer(Model):
    """Notified relabel: everything at ``from`` is now at ``to`` (a robot puts its grasped object down)."""

    type: Literal["transfer"] = "transfer"
    from_: LabelId = Field(alias="from")
    to: LabelId
    kind: Kind | None = None
    xy: Xy | None = None
    z: Metres | None = None
    cov: Covariance | None = None
    surface: str | None = Field(default=None, max_length=129)


class LoadChange(Model):
    """One load difference (signed, grams) over several labels whose shares cannot be told apart.

    Positive for labels that just appeared; negative, and sent before their ``label_vanished``, for labels about to go.
    """

    type: Literal["load_change"] = "load_change"
    labels: Annotated[list[LabelId], Field(min_length=1, max_length=100)]
    weight_g: Annotated[float, Field(ge=-1e7, le=1e7)]


class Correction(Model):
    """A person says that the object ``tag`` is (or is not) at ``label``."""

    type: Literal["correction"] = "correction"
    tag: Tag
    label: LabelId
    present: bool = True


class Tick(Model):
    """``n`` idle sensor cycles: no information. Scenario files only."""

    type: Literal["tick"] = "tick"
    n: Annotated[int, Field(ge=1)] = 1


Event = (
    LabelAppeared
    | LabelVanished
    | LabelMoved
    | MoverEntered
    | MoverLeft
    | TagObserved
    | TagMissed
    | Handover
    | HandoverPossible
    | MoverSwap
    | Transfer
    | LoadChange
    | Correction
    | Tick
)
AnyEvent = Annotated[Event, Field(discriminator="type")]
