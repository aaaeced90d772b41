"""Subcommands of `tms` that the server package brings."""
