"""The estimator in a process of its own, so that records and spool never wait for it."""

from __future__ import annotations

import asyncio
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from tms_agents.robot.estimating import Task, Update, estimate, prepare


class Estimator:
    """A process of its own; another one where it died."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None

    async def __call__(self, task: Task) -> Update:
        """Raises what the estimator raises, and ``BrokenProcessPool`` where its process died."""
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=prepare)
        try:
            return await asyncio.get_running_loop().run_in_executor(self._pool, estimate, task)
        except BrokenProcessPool:
            self.close()
            raise

    def close(self) -> None:
        """What is under way is given up."""
        if self._pool is not None:
            for process in list((self._pool._processes or {}).values()):
                process.kill()
            self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = None
