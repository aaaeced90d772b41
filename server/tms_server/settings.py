"""Settings of the server, from arguments and ``TMS_*`` environment variables; no global instance."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


class Settings(BaseSettings):
    model_config = SettingsConfigDict(env_prefix="TMS_", extra="forbid")

    data_dir: Path = Field(default=Path.home() / ".local/share/tms", description="SQLite file, compiled code, lock")
    database_url: str | None = Field(default=None, description="SQLAlchemy URL; SQLite in data_dir if absent")
    host: str = "127.0.0.1"
    port: int = Field(default=8080, ge=0, le=65535)

    # Ingest: what is refused (429/503) instead of dropped.
    max_body_bytes: int = 4_000_000
    linger_s: float = Field(
        default=0.005, ge=0, le=1, description="a batch waits this long for others that become durable with it"
    )
    queue_observations: int = Field(default=20_000, description="accepted but not yet durable, all agents together")
    queue_per_agent: int = Field(default=5_000, description="the same, one agent")
    fold_backlog: int = Field(default=100_000, description="durable but not yet folded, per room")

    # Belief.
    filter: str = Field(default="particle", pattern="^(particle|exact)$")
    budget: int = Field(default=1000, ge=1, description="hypotheses kept per room by the particle filter")
    holdback_s: float = Field(default=0.0, ge=0, description="wait this long for late arrivals before folding")
    patience_s: float = Field(
        default=5.0, ge=0, description="a vanished label nobody announced is an anomaly after this"
    )
    retention_s: float | None = Field(
        default=None, description="older arrivals change no belief; None keeps everything"
    )
    snapshot_every: int = Field(default=1000, ge=1, description="log records between two stored snapshots")
    silent_after_s: float = Field(default=30.0, gt=0, description="an agent that posts nothing this long is silent")

    def url(self) -> str:
        """The async SQLAlchemy URL (driver filled in)."""
        if self.database_url is None:
            return f"sqlite+aiosqlite:///{self.data_dir / 'tms.sqlite'}"
        url = self.database_url
        for plain, driver in (
            ("postgresql://", "postgresql+asyncpg://"),
            ("sqlite://", "sqlite+aiosqlite://"),
        ):
            if url.startswith(plain):
                return driver + url.removeprefix(plain)
        return url
