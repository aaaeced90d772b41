"""log in blocks, newest time of a room"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import sqlalchemy as sa
from alembic import op
from pydantic import AwareDatetime, TypeAdapter

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

_TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_TIME: TypeAdapter[datetime] = TypeAdapter(AwareDatetime)
#: Blocks read at a time.
_PAGE = 500


def upgrade() -> None:
    """Every row becomes a block of one record."""
    with op.batch_alter_table("rooms") as rooms:
        rooms.add_column(sa.Column("newest_at", sa.BigInteger(), nullable=True))
    op.execute(
        "update rooms set newest_at ="
        " (select max(observed_at) from log where log.room = rooms.room and kind <> 'registry')"
    )
    _set_aside("log", "log_0001")
    _blocks()
    op.execute(
        'insert into log (room, "offset", agent, seq, records, first_at, last_at, received_at, late, body)'
        ' select room, "offset", agent, seq, 1, observed_at, observed_at, received_at, late,'
        " case when kind = 'registry' then body else"
        """ '{"agent":"' || agent || '","room":"' || room || '","observations":[' || body || ']}' end"""
        " from log_0001"
    )
    op.drop_table("log_0001")


def downgrade() -> None:
    _set_aside("log", "log_0002")
    rows = _rows()
    blocks = sa.table("log_0002", *(sa.column(name) for name in (*_COMMON, "records", "first_at")))
    connection = op.get_bind()
    last: tuple[str, int] = ("", 0)
    while True:
        after = sa.tuple_(blocks.c.room, blocks.c.offset) > sa.tuple_(sa.literal(last[0]), sa.literal(last[1]))
        query = sa.select(blocks).where(after).order_by(blocks.c.room, blocks.c.offset).limit(_PAGE)
        page = connection.execute(query).mappings().all()
        if not page:
            break
        connection.execute(sa.insert(rows), [row for block in page for row in _opened(dict(block))])
        last = (page[-1]["room"], page[-1]["offset"])
    op.drop_table("log_0002")
    with op.batch_alter_table("rooms") as rooms:
        rooms.drop_column("newest_at")


_COMMON = ("room", "offset", "agent", "seq", "received_at", "late", "body")


def _set_aside(table: str, name: str) -> None:
    """Rename a log table; PostgreSQL keeps the names of its constraints for the one that follows it otherwise."""
    op.drop_index("ix_log_position", table)
    if op.get_bind().dialect.name == "postgresql":
        op.drop_constraint("uq_log_agent", table, type_="unique")
        op.drop_constraint("pk_log", table, type_="primary")
    op.rename_table(table, name)


def _blocks() -> None:
    op.create_table(
        "log",
        sa.Column("room", _TEXT, nullable=False),
        sa.Column("offset", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("agent", _TEXT, nullable=False),
        sa.Column("seq", sa.BigInteger(), nullable=False),
        sa.Column("records", sa.BigInteger(), nullable=False),
        sa.Column("first_at", sa.BigInteger(), nullable=False),
        sa.Column("last_at", sa.BigInteger(), nullable=False),
        sa.Column("received_at", sa.BigInteger(), nullable=False),
        sa.Column("late", sa.Boolean(), nullable=False),
        sa.Column("body", _TEXT, nullable=False),
        sa.PrimaryKeyConstraint("room", "offset", name=op.f("pk_log")),
        sa.UniqueConstraint("agent", "seq", name="uq_log_agent"),
    )
    op.create_index("ix_log_position", "log", ["room", "first_at", "agent", "seq"], unique=False)


def _rows() -> sa.Table:
    table = op.create_table(
        "log",
        sa.Column("room", _TEXT, nullable=False),
        sa.Column("offset", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("agent", _TEXT, nullable=False),
        sa.Column("seq", sa.BigInteger(), nullable=False),
        sa.Column("observed_at", sa.BigInteger(), nullable=False),
        sa.Column("received_at", sa.BigInteger(), nullable=False),
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("body", _TEXT, nullable=False),
        sa.Column("late", sa.Boolean(), nullable=False),
        sa.PrimaryKeyConstraint("room", "offset", name=op.f("pk_log")),
        sa.UniqueConstraint("agent", "seq", name="uq_log_agent"),
        sqlite_with_rowid=False,
    )
    op.create_index("ix_log_position", "log", ["room", "observed_at", "agent", "seq"], unique=False)
    return table


def _opened(block: Mapping[str, Any]) -> Iterable[dict[str, Any]]:
    common = {name: block[name] for name in ("room", "agent", "received_at", "late")}
    first_offset = block["offset"] - block["records"] + 1
    if block["agent"].startswith("@"):
        about = {"seq": block["seq"], "observed_at": block["first_at"], "kind": "registry", "body": block["body"]}
        yield common | about | {"offset": block["offset"]}
        return
    for i, item in enumerate(json.loads(block["body"])["observations"]):
        about = {"seq": item["seq"], "observed_at": _microseconds(item["observed_at"]), "kind": item["type"]}
        yield common | about | {"offset": first_offset + i, "body": json.dumps(item, ensure_ascii=False)}


def _microseconds(time: str | float) -> int:
    """Of any form of time that the wire accepts."""
    since = _TIME.validate_python(time) - datetime(1970, 1, 1, tzinfo=UTC)
    return since // timedelta(microseconds=1)
