"""Every table. Times are int64 microseconds UTC; documents are JSON text; both dialects hold the same types."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Float,
    ForeignKey,
    Index,
    LargeBinary,
    MetaData,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

NAMING = {
    "ix": "ix_%(table_name)s_%(column_0_name)s",
    "uq": "uq_%(table_name)s_%(column_0_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s",
    "pk": "pk_%(table_name)s",
}


#: Text compares by code point in both databases, so that paging and folding see one order.
_TEXT = Text().with_variant(Text(collation="C"), "postgresql")


class Base(DeclarativeBase):
    metadata = MetaData(naming_convention=NAMING)
    type_annotation_map = {int: BigInteger, str: _TEXT, float: Float(53), bytes: LargeBinary, bool: Boolean}


class ProductRow(Base):
    __tablename__ = "products"

    jan: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str]
    size_m: Mapped[str | None]
    weight_g: Mapped[float | None]
    weight_sd_g: Mapped[float | None]
    category: Mapped[str | None]
    shape: Mapped[str | None]
    #: Name, category and JAN, folded for search (objects/search.py).
    search_text: Mapped[str]
    updated_at: Mapped[int]


class ObjectRow(Base):
    __tablename__ = "objects"

    tag: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str]
    synonyms: Mapped[str]
    jan: Mapped[str | None] = mapped_column(ForeignKey("products.jan"), index=True)
    size_m: Mapped[str | None]
    weight_g: Mapped[float | None]
    weight_sd_g: Mapped[float | None]
    category: Mapped[str | None]
    room: Mapped[str | None] = mapped_column(ForeignKey("rooms.room"), index=True)
    tracking: Mapped[str]
    #: Its own; NULL where it is that of its product.
    shape: Mapped[str | None]
    tag_pose: Mapped[str | None]
    user_memory: Mapped[bytes | None]
    #: Name, synonyms, category (also the product's), tag and JAN, folded for search (objects/search.py).
    search_text: Mapped[str]
    created_at: Mapped[int]
    updated_at: Mapped[int]


class RoomRow(Base):
    __tablename__ = "rooms"

    room: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[str]
    created_at: Mapped[int]
    updated_at: Mapped[int]
    #: Newest log offset; its row lock orders the offsets of a room.
    head: Mapped[int] = mapped_column(default=0)
    #: Newest time of observation; NULL before the first.
    newest_at: Mapped[int | None]


class LogRow(Base):
    """The room log: the truth from which every belief is folded. A row is a block of records (log/blocks.py).

    Observations carry the agent's (agent, seq); registry records (object registered, room changed ...) the agent
    ``@<room>``, a name that no agent can have, and the room's own running number.
    """

    __tablename__ = "log"
    __table_args__ = (
        Index("ix_log_position", "room", "first_at", "agent", "seq"),
        UniqueConstraint("agent", "seq", name="uq_log_agent"),
    )

    room: Mapped[str] = mapped_column(primary_key=True)
    #: Of the block's last record.
    offset: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    agent: Mapped[str]
    #: Of the block's first record.
    seq: Mapped[int]
    #: How many: their offsets and seqs run on without gaps.
    records: Mapped[int]
    #: Smallest and largest observed_at.
    first_at: Mapped[int]
    last_at: Mapped[int]
    received_at: Mapped[int]
    #: Arrived after the retention window: kept, but no belief knows it.
    late: Mapped[bool]
    body: Mapped[str]


class AgentRow(Base):
    __tablename__ = "agents"

    agent: Mapped[str] = mapped_column(primary_key=True)
    room: Mapped[str]
    next_seq: Mapped[int]
    received: Mapped[int]
    first_seen: Mapped[int]
    last_seen: Mapped[int]
    last_observed_at: Mapped[int]
    state: Mapped[str]
    why: Mapped[str]


class UnknownTagRow(Base):
    __tablename__ = "unknown_tags"

    tag: Mapped[str] = mapped_column(primary_key=True)
    room: Mapped[str] = mapped_column(primary_key=True)
    agent: Mapped[str]
    #: Smallest and largest observed_at, whatever the order of arrival.
    first_seen: Mapped[int]
    last_seen: Mapped[int]
    count: Mapped[int]
    label: Mapped[str | None]
    x: Mapped[float | None]
    y: Mapped[float | None]


class SnapshotRow(Base):
    """A folded state: of all records up to ``offset``, the last of them (in fold order) at the given position."""

    __tablename__ = "snapshots"

    room: Mapped[str] = mapped_column(primary_key=True)
    offset: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    observed_at: Mapped[int]
    agent: Mapped[str]
    seq: Mapped[int]
    created_at: Mapped[int]
    body: Mapped[bytes]


class MapRow(Base):
    __tablename__ = "maps"

    map: Mapped[str] = mapped_column(primary_key=True)
    room: Mapped[str] = mapped_column(ForeignKey("rooms.room"), index=True)
    name: Mapped[str | None]
    #: Metres per cell; the lower left corner of cell (0, 0) in the map frame.
    resolution: Mapped[float]
    origin_x: Mapped[float]
    origin_y: Mapped[float]
    map_to_room: Mapped[str | None]
    #: The newest version, 0 before the first.
    version: Mapped[int]
    created_at: Mapped[int]
    updated_at: Mapped[int]


class MapVersionRow(Base):
    __tablename__ = "map_versions"

    map: Mapped[str] = mapped_column(ForeignKey("maps.map", ondelete="CASCADE"), primary_key=True)
    version: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    created_at: Mapped[int]
    agent: Mapped[str]
    note: Mapped[str]
    #: SHA-256 of what was asked for, so that the same request again is known.
    request: Mapped[str]
    #: x0, y0, x1, y1 in cells as JSON; NULL where nothing is known.
    bounds: Mapped[str | None]
    changed: Mapped[int]
    #: All semi-dynamic objects as JSON; NULL where they are those of the version before.
    objects: Mapped[str | None]


class MapBlobRow(Base):
    """A tile's content, once per map whatever number of versions and places has it."""

    __tablename__ = "map_blobs"

    map: Mapped[str] = mapped_column(ForeignKey("maps.map", ondelete="CASCADE"), primary_key=True)
    digest: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[bytes]
    #: Known cells within the tile: columns left to right and rows bottom to top, the upper ends excluded.
    left: Mapped[int]
    bottom: Mapped[int]
    right: Mapped[int]
    top: Mapped[int]
    #: When it was last sent; what no version names goes after a while.
    sent_at: Mapped[int]


class MapTileRow(Base):
    """What the tile at (x, y) holds from version ``since`` on and before version ``until`` (NULL: to this day)."""

    __tablename__ = "map_tiles"
    __table_args__ = (
        Index("ix_map_tiles_since", "map", "since"),
        Index("ix_map_tiles_until", "map", "until"),
        Index("ix_map_tiles_digest", "map", "digest"),
    )

    map: Mapped[str] = mapped_column(ForeignKey("maps.map", ondelete="CASCADE"), primary_key=True)
    x: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    y: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    since: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    until: Mapped[int | None]
    digest: Mapped[str]


class KeyRow(Base):
    __tablename__ = "api_keys"

    id: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str]
    #: SHA-256 of the secret (256 random bits: nothing to stretch).
    digest: Mapped[bytes]
    scopes: Mapped[str]
    created_at: Mapped[int]
    revoked_at: Mapped[int | None]
