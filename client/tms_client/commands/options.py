"""Options shared by commands that talk to a server."""

from __future__ import annotations

import argparse
import os

DEFAULT_URL = "http://127.0.0.1:8080"


def add_server_options(parser: argparse.ArgumentParser) -> None:
    """``--url`` and ``--key``, with ``TMS_URL`` and ``TMS_KEY`` of the environment as defaults."""
    parser.add_argument(
        "--url",
        default=os.environ.get("TMS_URL", DEFAULT_URL),
        help=f"address of the server (default: TMS_URL or {DEFAULT_URL})",
    )
    parser.add_argument("--key", default=os.environ.get("TMS_KEY"), help="API key (default: TMS_KEY)")
