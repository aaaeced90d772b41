"""objects: a shape of their own, for what is no product (a door)"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

_TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")


def upgrade() -> None:
    op.add_column("objects", sa.Column("shape", _TEXT, nullable=True))


def downgrade() -> None:
    op.drop_column("objects", "shape")
