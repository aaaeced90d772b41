"""``uvicorn tms_server.asgi:app``: the one module with a side effect on import."""

from __future__ import annotations

from tms_server.compiled import use_compiled_cache
from tms_server.settings import Settings

settings = Settings()
use_compiled_cache(settings.data_dir)

from tms_server.app import create_app  # noqa: E402  (numba reads its cache directory on import)
from tms_server.garbage import tune_garbage_collector  # noqa: E402

app = create_app(settings)
tune_garbage_collector()
