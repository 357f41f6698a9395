"""`headimpact work`: run jobs and schedules without serving, beside services that need not."""

from __future__ import annotations

import signal
import threading
from types import FrameType

from headimpact_service import logs, memory
from headimpact_service.cli.database import migrated
from headimpact_service.cli.serve import say
from headimpact_service.jobs.engine import engine_of
from headimpact_service.settings import Settings


def run(*, database_url: str | None) -> None:
    """Work until the process is told to stop; what is under way then is handed back."""
    settings = Settings() if database_url is None else Settings(database_url=database_url)
    logs.configure(settings.log_level)
    memory.give_back()
    stopped = threading.Event()

    def stop(_number: int, _frame: FrameType | None) -> None:
        stopped.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    with migrated(settings.database_url) as database:
        engine = engine_of(settings, database)
        memory.spare_the_collector()
        engine.start()
        say("Working.")
        stopped.wait()
        engine.stop()
