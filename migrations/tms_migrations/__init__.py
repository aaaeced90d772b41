"""Alembic migrations of the server's database; they run from the installed wheel."""
