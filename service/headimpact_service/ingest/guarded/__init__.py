"""Readers of formats that strangers can make hostile, run in a process of their own under hard limits.

:mod:`.worker` is that process; it imports nothing of the service but the plain modules of `ingest`. The service speaks
to it through :mod:`headimpact_service.ingest.guard`, over the frames of :mod:`.wire`, and never imports a reader.
"""
