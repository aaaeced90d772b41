"""Subcommands of ``tms`` that need nothing but the client."""
