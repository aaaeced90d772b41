"""Engines per dialect, tables, sessions, migrations and the one-process lock."""
