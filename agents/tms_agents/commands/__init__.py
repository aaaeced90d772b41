"""Subcommands of ``tms`` that run on sensor hosts."""
