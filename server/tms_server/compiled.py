"""Where numba keeps compiled kernels. Set before numba is first imported; it reads the variable only then."""

from __future__ import annotations

import os
from pathlib import Path


def use_compiled_cache(data_dir: Path) -> None:
    """Keep compiled code beside the data, unless ``NUMBA_CACHE_DIR`` already says otherwise."""
    os.environ.setdefault("NUMBA_CACHE_DIR", str(data_dir / "compiled"))
