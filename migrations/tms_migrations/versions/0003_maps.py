"""maps: versions, tiles by content"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

_TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")


def upgrade() -> None:
    op.create_table(
        "maps",
        sa.Column("map", _TEXT, nullable=False),
        sa.Column("room", _TEXT, nullable=False),
        sa.Column("name", _TEXT, nullable=True),
        sa.Column("resolution", sa.Float(53), nullable=False),
        sa.Column("origin_x", sa.Float(53), nullable=False),
        sa.Column("origin_y", sa.Float(53), nullable=False),
        sa.Column("map_to_room", _TEXT, nullable=True),
        sa.Column("version", sa.BigInteger(), nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("updated_at", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["room"], ["rooms.room"], name=op.f("fk_maps_room")),
        sa.PrimaryKeyConstraint("map", name=op.f("pk_maps")),
    )
    op.create_index(op.f("ix_maps_room"), "maps", ["room"], unique=False)
    op.create_table(
        "map_versions",
        sa.Column("map", _TEXT, nullable=False),
        sa.Column("version", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("created_at", sa.BigInteger(), nullable=False),
        sa.Column("agent", _TEXT, nullable=False),
        sa.Column("note", _TEXT, nullable=False),
        sa.Column("request", _TEXT, nullable=False),
        sa.Column("bounds", _TEXT, nullable=True),
        sa.Column("changed", sa.BigInteger(), nullable=False),
        sa.Column("objects", _TEXT, nullable=True),
        sa.ForeignKeyConstraint(["map"], ["maps.map"], name=op.f("fk_map_versions_map"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("map", "version", name=op.f("pk_map_versions")),
    )
    op.create_table(
        "map_blobs",
        sa.Column("map", _TEXT, nullable=False),
        sa.Column("digest", _TEXT, nullable=False),
        sa.Column("body", sa.LargeBinary(), nullable=False),
        *(sa.Column(side, sa.BigInteger(), nullable=False) for side in ("left", "bottom", "right", "top")),
        sa.Column("sent_at", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(["map"], ["maps.map"], name=op.f("fk_map_blobs_map"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("map", "digest", name=op.f("pk_map_blobs")),
    )
    op.create_table(
        "map_tiles",
        sa.Column("map", _TEXT, nullable=False),
        sa.Column("x", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("y", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("since", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("until", sa.BigInteger(), nullable=True),
        sa.Column("digest", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["map"], ["maps.map"], name=op.f("fk_map_tiles_map"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("map", "x", "y", "since", name=op.f("pk_map_tiles")),
    )
    op.create_index("ix_map_tiles_since", "map_tiles", ["map", "since"], unique=False)
    op.create_index("ix_map_tiles_until", "map_tiles", ["map", "until"], unique=False)
    op.create_index("ix_map_tiles_digest", "map_tiles", ["map", "digest"], unique=False)


def downgrade() -> None:
    for table in ("map_tiles", "map_blobs", "map_versions", "maps"):
        op.drop_table(table)
