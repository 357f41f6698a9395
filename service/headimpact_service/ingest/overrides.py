"""What the sender gives beside a file, put in place of what the file says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from headimpact.recording import Recording, Signal
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.stamps import DRIFT, follows


def with_options(record: ImpactRecord, options: ImportOptions) -> ImpactRecord:
    """The record as the sender's fields have it."""
    recording = _recording(record.recording, options)
    changes: dict[str, Any] = {} if recording is record.recording else {"recording": recording}
    if options.athlete is not None:
        changes |= {"athlete_id": None, "athlete_external_id": options.athlete}
    if options.device is not None:
        changes["device_serial"] = options.device
    if options.occurred_at is not None:
        changes["occurred_at"] = options.occurred_at
    if options.filename is not None:
        changes["metadata"] = {**record.metadata, "file": options.filename}
    return replace(record, **changes) if changes else record


def _recording(recording: Recording, options: ImportOptions) -> Recording:
    changes: dict[str, Any] = {}
    if options.axes is not None:
        changes["axes"] = options.axes
    if options.low_pass is not None:
        changes["low_pass"] = options.low_pass
    if options.fill_gaps:
        changes["fill_gaps"] = True
    if options.sample_rate_hz is not None:
        changes |= {name: _at_rate(signal, options.sample_rate_hz) for name, signal in recording.signals()}
    return replace(recording, **changes) if changes else recording


def _at_rate(signal: Signal, sample_rate_hz: float) -> Signal:
    """A signal at the sender's rate; 422 where the file says another."""
    if signal.time_s is not None:
        agrees = follows(signal.time_s * 1000.0, sample_rate_hz)
    else:
        own = signal.sample_rate_hz
        agrees = own is None or abs(own - sample_rate_hz) <= DRIFT * own
    if not agrees:
        raise file_fault(
            f"The file's own times or rate are not those of {sample_rate_hz:g} samples per second: leave out the rate "
            "beside it.",
            "rate-differs",
            parameter="sample_rate_hz",
        )
    return replace(signal, sample_rate_hz=sample_rate_hz, time_s=None)
