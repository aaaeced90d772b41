"""What an agent has observed and the server has not acknowledged yet, on disk (SQLite, WAL, synchronous=FULL).

An observation is in the spool when ``put`` returns and leaves it only by ``acknowledge`` or, with the server's reason,
as a dead letter by ``bury``. Sequence and label numbers are persisted here and never used twice. A spool that is full
refuses; it drops nothing. So does one whose disk is full or fails: what it took stays, and it takes again when the disk
does. One process owns a spool file: a second one is refused.
"""

from __future__ import annotations

import contextlib
import itertools
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tms_client.api import to_wire
from tms_client.errors import SpoolError, SpoolFull
from tms_schemas.observation import Observation

#: The disk is full, or over its quota, or fails: that may pass.
_REFUSALS = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR)


class Item(NamedTuple):
    """A numbered observation waiting for its acknowledgement; ``body`` is its JSON without ``seq``."""

    seq: int
    room: str
    body: str


class DeadLetter(NamedTuple):
    """An observation the server will never take, and why; ``at`` is the Unix time of the refusal."""

    seq: int
    room: str
    body: str
    reason: str
    at: float


class Spool:
    """The durable queue of one agent.

    A new spool does not know which numbers the agent used before (its disk may have been lost): observations wait
    unnumbered until ``continue_at`` tells, labels taken before that start at the clock's milliseconds.
    """

    def __init__(
        self,
        path: Path | str,
        agent: str,
        *,
        max_items: int = 200_000,
        max_bytes: int = 64_000_000,
        max_dead: int = 10_000,
        clock: Callable[[], float] = time.time,
    ) -> None:
        """Open or create.

        Raises:
            SpoolError: the file belongs to another agent, is open in another process, is no spool, or cannot be made.
        """
        self.agent = agent
        self._max_items, self._max_bytes, self._max_dead = max_items, max_bytes, max_dead
        self._clock = clock
        self._lock = threading.RLock()
        #: The next label number, where the disk has not taken it yet.
        self._next_label: int | None = None
        try:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=1.0, isolation_level=None, check_same_thread=False)
        except (OSError, sqlite3.Error) as error:
            raise SpoolError(f"spool {path}: {getattr(error, 'strerror', None) or error}") from error
        try:
            self._open()
        except (sqlite3.Error, SpoolError) as error:
            self._db.close()
            busy = isinstance(error, sqlite3.Error) and error.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY
            why = "an agent with this spool is running already" if busy else error
            raise SpoolError(f"spool {path}: {why}") from error

    # filling

    def put(self, room: str, *observations: Observation, keep: Mapping[str, str] | None = None) -> None:
        """Store observations durably, all or none. Their ``seq`` is replaced by the agent's running number.

        ``keep`` are notes of the agent to itself (see ``kept``), written together with what they belong to.

        Raises:
            SpoolFull: there is no place; the refusal is counted in ``refused``, unless it is the disk that is full.
        """
        bodies = [to_wire(one, numbered=False) for one in observations]
        size = sum(map(_size, bodies))
        with self._lock:
            if self.pending + len(bodies) > self._max_items or self.pending_bytes + size > self._max_bytes:
                with self._transaction():
                    self._set("refused", self.refused + len(bodies))
                raise SpoolFull(
                    f"the spool of {self.agent} is full: {self.pending} observations ({self.pending_bytes} bytes) "
                    "wait for the server"
                )
            with self._transaction():
                first = self.next_seq
                rows = [(None if first is None else first + i, room, body) for i, body in enumerate(bodies)]
                self._db.executemany("INSERT INTO item (seq, room, body) VALUES (?, ?, ?)", rows)
                if first is not None:
                    self._set("next_seq", first + len(bodies))
                if self._next_label is not None:  # what is put names labels that were given since
                    self._set("next_label", self._next_label)
                self._db.executemany("INSERT OR REPLACE INTO note (name, text) VALUES (?, ?)", (keep or {}).items())
            self._next_label = None
            self.pending += len(bodies)
            self.pending_bytes += size

    def new_label(self) -> str:
        """A label id ``agent/n`` that this agent never used and never will again.

        Also where the disk is full: nothing that names it is taken before its number is on the disk.
        """
        with self._lock:
            n = self._get("next_label") if self._next_label is None else self._next_label
            n = int(self._clock() * 1000) if n is None else n
            self._next_label = n + 1
            with contextlib.suppress(SpoolFull):
                with self._transaction():
                    self._set("next_label", n + 1)
                self._next_label = None
        return f"{self.agent}/{n}"

    @property
    def remembers(self) -> bool:
        """Whether all labels that were given are on the disk: before that nobody else may note them down."""
        return self._next_label is None

    def kept(self, name: str) -> str | None:
        """The last note of that name; a restarted agent goes on from it. None where there is none."""
        with self._lock:
            row = self._db.execute("SELECT text FROM note WHERE name = ?", (name,)).fetchone()
        return None if row is None else str(row[0])

    # emptying

    @property
    def next_seq(self) -> int | None:
        """The number of the next observation; None until ``continue_at`` was called once."""
        return self._get("next_seq")

    def continue_at(self, next_seq: int, first_label: int = 1) -> None:
        """Go on with numbers the server has not seen: observations from ``next_seq``, labels from ``first_label``.

        A spool that is ahead stays so; one that fell behind (restored from an old copy) jumps forward.
        """
        with self._lock:
            with self._transaction():
                known = self.next_seq
                seq = max(known or 0, next_seq)
                further = known is None or next_seq > known
                if further:
                    self._set("next_label", max(self._next_label or self._get("next_label") or 0, first_label))
                waiting = self._db.execute("SELECT n FROM item WHERE seq IS NULL ORDER BY n").fetchall()
                numbered = [(seq + i, n) for i, (n,) in enumerate(waiting)]
                self._db.executemany("UPDATE item SET seq = ? WHERE n = ?", numbered)
                self._set("next_seq", seq + len(waiting))
            if further:
                self._next_label = None

    def peek(self, limit: int) -> list[Item]:
        """The oldest numbered observations, at most ``limit``, all of one room."""
        with self._lock:
            rows = self._db.execute(
                "SELECT seq, room, body FROM item WHERE seq IS NOT NULL ORDER BY n LIMIT ?", (limit,)
            )
            items = [Item(*row) for row in rows]
        return list(itertools.takewhile(lambda item: item.room == items[0].room, items))

    def acknowledge(self, items: Sequence[Item]) -> None:
        """The server has them durably: forget them."""
        with self._lock:
            with self._transaction():
                removed = self._remove(items)
            self._took(removed)

    def bury(self, item: Item, reason: str) -> None:
        """Move one observation to the dead letters. Of these the newest ``max_dead`` are kept; all are counted."""
        with self._lock:
            with self._transaction():
                removed = self._remove([item])
                self._db.execute(
                    "INSERT INTO dead (seq, room, body, reason, at) VALUES (?, ?, ?, ?, ?)",
                    (item.seq, item.room, item.body, reason, self._clock()),
                )
                self._db.execute("DELETE FROM dead WHERE n <= (SELECT max(n) FROM dead) - ?", (self._max_dead,))
                self._set("buried", self.buried + 1)
            self._took(removed)

    # looking

    @property
    def refused(self) -> int:
        """Observations that ``put`` refused because the spool was full, ever."""
        return self._get("refused") or 0

    @property
    def buried(self) -> int:
        """Observations that became dead letters, ever."""
        return self._get("buried") or 0

    def dead_letters(self) -> list[DeadLetter]:
        with self._lock:
            rows = self._db.execute("SELECT seq, room, body, reason, at FROM dead ORDER BY n").fetchall()
        return [DeadLetter(*row) for row in rows]

    def __len__(self) -> int:
        return self.pending

    def close(self) -> None:
        with self._lock:
            self._db.close()

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # below: SQLite

    def _open(self) -> None:
        # Exclusive: a second agent on the same file would give the same numbers to other observations.
        self._db.execute("PRAGMA locking_mode = EXCLUSIVE")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        with self._transaction():
            for statement in _TABLES:
                self._db.execute(statement)
            owner = self._db.execute("SELECT agent FROM owner").fetchone()
            if owner is None:
                self._db.execute("INSERT INTO owner (agent) VALUES (?)", (self.agent,))
            elif owner[0] != self.agent:
                raise SpoolError(f"belongs to agent {owner[0]!r}, not {self.agent!r}")
        row = self._db.execute("SELECT count(*), coalesce(sum(length(CAST(body AS BLOB))), 0) FROM item").fetchone()
        #: Observations waiting, and the bytes of their bodies.
        self.pending: int = row[0]
        self.pending_bytes: int = row[1]

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield
            self._db.execute("COMMIT")
        except BaseException as error:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            if isinstance(error, sqlite3.Error):
                refused = error.sqlite_errorcode & 0xFF in _REFUSALS
                raise (SpoolFull if refused else SpoolError)(f"spool of {self.agent}: {error}") from error
            raise

    def _get(self, name: str) -> int | None:
        with self._lock:
            row = self._db.execute("SELECT value FROM number WHERE name = ?", (name,)).fetchone()
        return None if row is None else int(row[0])

    def _set(self, name: str, value: int) -> None:
        self._db.execute("INSERT OR REPLACE INTO number (name, value) VALUES (?, ?)", (name, value))

    def _remove(self, items: Sequence[Item]) -> list[Item]:
        """Delete; returns those that were still there (a cancelled round may have been faster)."""
        delete = "DELETE FROM item WHERE seq = ?"
        return [item for item in items if self._db.execute(delete, (item.seq,)).rowcount]

    def _took(self, items: Sequence[Item]) -> None:
        self.pending -= len(items)
        self.pending_bytes -= sum(_size(item.body) for item in items)


_TABLES = (
    "CREATE TABLE IF NOT EXISTS owner (agent TEXT NOT NULL)",
    "CREATE TABLE IF NOT EXISTS number (name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID",
    "CREATE TABLE IF NOT EXISTS note (name TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE IF NOT EXISTS item (n INTEGER PRIMARY KEY AUTOINCREMENT, seq INTEGER UNIQUE, room TEXT NOT NULL,"
    " body TEXT NOT NULL)",
    "CREATE TABLE IF NOT EXISTS dead (n INTEGER PRIMARY KEY AUTOINCREMENT, seq INTEGER NOT NULL, room TEXT NOT NULL,"
    " body TEXT NOT NULL, reason TEXT NOT NULL, at REAL NOT NULL)",
)


def _size(body: str) -> int:
    return len(body.encode())
