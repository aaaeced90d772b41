"""The page at ``/``: static ES modules, no build step, no internet."""

from __future__ import annotations

from fastapi import FastAPI


def install_page(app: FastAPI) -> None:
    """Serve the page and its modules."""
