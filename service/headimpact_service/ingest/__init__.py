"""Bytes in, :class:`~headimpact_service.ingest.record.ImpactRecord` out: one module per format, one preset per device.

JSON bodies are read by :mod:`.impact_json`, files by :mod:`.upload`; nothing here knows of the web or the database.
"""
