"""What can be configured: environment variables with the prefix HEADIMPACT_, each with a default that works."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

MEBIBYTE = 1024 * 1024
PREFIX = "HEADIMPACT_"


class Settings(BaseSettings):
    """The configuration of one process, read once at its start."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="ignore")

    database_url: str = Field(default="sqlite:///headimpact.db", description="SQLAlchemy URL of the database.")
    host: str = Field(default="127.0.0.1", min_length=1, description="Address to listen on.")
    port: int = Field(default=8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one.")
    max_body: int = Field(default=8 * MEBIBYTE, ge=1, description="Largest JSON body, as sent and inflated [bytes].")
    max_upload: int = Field(default=512 * MEBIBYTE, ge=1, description="Largest upload, as sent and inflated [bytes].")
    upload_folder: Path | None = Field(
        default=None, description="Where large uploads wait for their job; beside an SQLite file unless set."
    )
    job_retention_days: int = Field(default=30, ge=1, description="Ended jobs stay listed this long [days].")
    job_memory: int = Field(
        default=4096 * MEBIBYTE, ge=256 * MEBIBYTE, description="Most memory a job's process may take [bytes]."
    )
    head_timeout_s: float = Field(default=20.0, gt=0, description="A request's head must arrive within this time [s].")
    body_timeout_s: float = Field(default=30.0, gt=0, description="Longest pause between two parts of a body [s].")
    rate_limit: int | None = Field(default=None, ge=1, description="Requests a minute and key; none unless set.")
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="Least severe line logged."
    )
    access_log: bool = Field(default=False, description="One structured line for each request.")


def unknown_variables() -> list[str]:
    """What an operator should know of variables that look like ours and are none: they change nothing."""
    known = {f"{PREFIX}{name.upper()}" for name in Settings.model_fields}
    found = sorted(name for name in os.environ if name.upper().startswith(PREFIX) and name.upper() not in known)
    return [f"{name} is set, and is no setting of this service: it changes nothing." for name in found]
