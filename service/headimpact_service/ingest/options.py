"""What comes beside an uploaded file and overrides what is in it."""

from __future__ import annotations

from collections.abc import Mapping as Fields
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from headimpact.cut_offs import LowPass
from headimpact.recording import AxesName
from headimpact_service.errors import PayloadError, Problem
from headimpact_service.ingest.impact_json import MAX_RATE_HZ, MIN_RATE_HZ, Axes, Filter, Name
from headimpact_service.ingest.impact_reading import low_pass
from headimpact_service.ingest.json_faults import member_errors, payload_errors, validation_problem
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.times import TimeError, instant, known_zone

MAX_IMPACTS = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """The fields of an import. `time_zone` places local times, of the file as of `occurred_at`.

    `filename` and `content_type` only say what the sender calls the file; what it is, its content says.
    """

    preset: str | None = None
    mapping: Mapping | None = None
    athlete: str | None = None
    device: str | None = None
    occurred_at: datetime | None = None
    time_zone: str | None = None
    sample_rate_hz: float | None = None
    axes: AxesName | None = None
    low_pass: LowPass | None = None
    fill_gaps: bool = False
    filename: str | None = None
    content_type: str | None = None
    max_impacts: int = MAX_IMPACTS

    @classmethod
    def from_fields(cls, fields: Fields[str, str], **known: Any) -> ImportOptions:  # noqa: ANN401 - the other members
        """The options that form fields or query parameters give; an empty field counts as not given.

        Raises
        ------
        Problem
            422 ``invalid-parameter`` with every field that breaks a rule.
        """
        reading = _Reading({name: text for name, text in fields.items() if text})
        options = cls(
            preset=reading.checked("preset", _NAME),
            mapping=reading.mapping(),
            athlete=reading.checked("athlete", _NAME),
            device=reading.checked("device", _NAME),
            occurred_at=reading.instant(),
            time_zone=reading.fields.get("time_zone"),
            sample_rate_hz=reading.checked("sample_rate_hz", _RATE),
            axes=reading.checked("axes", _AXES),
            low_pass=reading.filter(),
            fill_gaps=reading.flag("fill_gaps"),
            **known,
        )
        if reading.faults:
            raise Problem("invalid-parameter", "A field beside the file breaks a rule.", errors=reading.faults)
        return options


_NAME: TypeAdapter[Any] = TypeAdapter(Name)
_RATE: TypeAdapter[Any] = TypeAdapter(Annotated[float, Field(ge=MIN_RATE_HZ, le=MAX_RATE_HZ, allow_inf_nan=False)])
_AXES: TypeAdapter[Any] = TypeAdapter(Axes)
_FILTER: TypeAdapter[Any] = TypeAdapter(Filter)


class _Reading:
    """Fields as they are read, and what is wrong with them."""

    def __init__(self, fields: dict[str, str]) -> None:
        self.fields = fields
        self.faults: list[PayloadError] = []

    def checked(self, name: str, rule: TypeAdapter[Any]) -> Any:  # noqa: ANN401 - the rule's type
        """The field's value under a rule for its text."""
        if name not in self.fields:
            return None
        try:
            return rule.validate_python(self.fields[name])
        except ValidationError as error:
            self._refuse(name, payload_errors(error.errors(include_url=False, include_input=False), None))
            return None

    def mapping(self) -> Mapping | None:
        """The field `mapping`: JSON, with pointers into it for what it breaks."""
        text = self.fields.get("mapping")
        if text is None:
            return None
        data = text.encode("utf-8", "replace")
        try:
            mapping = Mapping.model_validate_json(data)
        except ValidationError as error:
            problem = validation_problem(error, data, what="mapping")
            malformed = PayloadError(detail=problem.detail, code="not-json", pointer="")
            self._refuse("mapping", problem.errors or [malformed], keep_pointer=True)
            return None
        self._refuse("mapping", member_errors(data, mapping), keep_pointer=True)
        return mapping

    def filter(self) -> LowPass | None:
        """The field `filter`: a name, or JSON with a cut-off for each signal."""
        text = self.fields.get("filter")
        if text is None:
            return None
        try:
            choice = _FILTER.validate_json(text) if text.startswith("{") else _FILTER.validate_python(text)
        except ValidationError as error:
            self._refuse("filter", payload_errors(error.errors(include_url=False, include_input=False), None))
            return None
        self._refuse("filter", member_errors(text.encode("utf-8", "replace"), choice))
        return low_pass(choice)

    def flag(self, name: str) -> bool:
        """A field that is true or false; not given, it is false."""
        text = self.fields.get(name, "false")
        if text not in {"true", "false"}:
            self.faults.append(PayloadError(detail="true or false is needed.", code="wrong-type", parameter=name))
        return text == "true"

    def instant(self) -> datetime | None:
        """The fields `occurred_at` and `time_zone`."""
        text, zone = self.fields.get("occurred_at"), self.fields.get("time_zone")
        try:
            if text is not None:
                return instant(text, zone)
            if zone is not None:
                known_zone(zone)
        except TimeError as error:
            self.faults.append(PayloadError(detail=str(error), code=error.code, parameter=error.field))
        return None

    def _refuse(self, name: str, errors: Any, *, keep_pointer: bool = False) -> None:  # noqa: ANN401 - payload errors
        for error in errors:
            pointer = error.pointer if keep_pointer else None
            self.faults.append(PayloadError(detail=error.detail, code=error.code, parameter=name, pointer=pointer))
