"""The sample rate of a DTS / TDAS CSV: its header's or, where that says none, the sender's."""

from __future__ import annotations

from dataclasses import replace

from headimpact.recording import SIGNALS
from headimpact_service.errors import Problem
from headimpact_service.ingest.dts_header import Header
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.stamps import DRIFT


def with_mapped_rate(options: ImportOptions) -> ImportOptions:
    """A mapping that says a rate and nothing else, as the same rate beside the file."""
    asked = options.mapping
    if asked is None or asked.model_fields_set != {"sample_rate_hz"}:
        return options
    if options.sample_rate_hz not in {None, asked.sample_rate_hz}:
        raise _rates_differ(asked.sample_rate_hz, options.sample_rate_hz)
    return replace(options, mapping=None, sample_rate_hz=asked.sample_rate_hz)


def sample_rate(header: Header, options: ImportOptions) -> float:
    """The rate that the header says, or else the sender."""
    told, asked = header.rate_hz, _mapped_rate(options)
    if told is not None and told > 0.0:
        if asked is not None and abs(asked - told) > DRIFT * told:
            raise _rates_differ(asked, told)
        return told
    given = options.sample_rate_hz or asked
    if given is None:
        raise file_fault(
            "The header gives no sample rate: give sample_rate_hz beside the file.",
            "rate-missing",
            parameter="sample_rate_hz",
        )
    return given


def _mapped_rate(options: ImportOptions) -> float | None:
    """The rate of a mapping: its own, or the one that its signals share."""
    asked = options.mapping
    if asked is None or asked.sample_rate_hz is not None:
        return None if asked is None else asked.sample_rate_hz
    rates = {columns.sample_rate_hz for name in SIGNALS if (columns := asked.columns_of(name)) is not None}
    return rates.pop() if len(rates) == 1 else None


def _rates_differ(asked: float | None, told: float | None) -> Problem:
    detail = f"The mapping says {asked:g} samples per second where {told:g} are said: leave out the rate that is wrong."
    return file_fault(detail, "rates-differ", parameter="mapping", pointer="/sample_rate_hz")
