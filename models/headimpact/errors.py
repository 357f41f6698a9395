"""The errors of the science: few, its own, and free of HTTP."""

from __future__ import annotations


class HeadimpactError(Exception):
    """The root of every error this package raises on purpose."""


class TraceError(HeadimpactError, ValueError):
    """A recording that breaks a rule and so cannot be scored.

    Parameters
    ----------
    code
        The rule that is broken, as a slug (``"time-not-increasing"``).
    message
        A sentence for people. It names the rule and its bound, never the offending value.
    signal
        ``"linear_acceleration"``, ``"angular_velocity"`` or ``"angular_acceleration"``, where one signal is to blame.
    channel
        ``"x"``, ``"y"`` or ``"z"``, where one component is.
    index
        The 0-based sample at which the rule is first broken.
    """

    def __init__(
        self,
        code: str,
        message: str,
        *,
        signal: str | None = None,
        channel: str | None = None,
        index: int | None = None,
    ) -> None:
        super().__init__(message)
        self.code = code
        self.signal = signal
        self.channel = channel
        self.index = index


class OperatingPointUnreachable(HeadimpactError, ValueError):  # noqa: N818 - named for what it says, not for its base
    """An operating point that the model cannot give: its source publishes none there."""


class UnknownModel(HeadimpactError, KeyError):  # noqa: N818 - named for what it says, not for its base
    """No published model has this version."""

    def __str__(self) -> str:
        return str(self.args[0])


class UnknownCriterion(HeadimpactError, KeyError):  # noqa: N818 - named for what it says, not for its base
    """No criterion has this name."""

    def __str__(self) -> str:
        return str(self.args[0])


class CalibrationError(HeadimpactError, ValueError):
    """A sample that no risk curve can be fitted to, or options that do not fit it.

    Parameters
    ----------
    code
        What is wrong, as a slug (``"no-events"``).
    message
        A sentence for people: what is missing, and how much of it would do.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class SeparationError(CalibrationError):
    """Predictors that tell every event from every other impact: the likelihood has no maximum.

    Parameters
    ----------
    kind
        ``"complete"``, or ``"quasi-complete"`` where only impacts on the boundary are of both kinds.
    """

    def __init__(self, kind: str) -> None:
        super().__init__(
            "separation",
            f"The outcome is separated ({kind}): some plane has every concussion on one side, so that maximum "
            "likelihood gives infinite slopes. More impacts of both kinds are needed, or Firth's correction.",
        )
        self.kind = kind


class ModelDocumentError(HeadimpactError, ValueError):
    """A document that is no risk model.

    Parameters
    ----------
    pointer
        Where in the document, as a JSON pointer.
    message
        The rule that is broken.
    """

    def __init__(self, pointer: str, message: str) -> None:
        super().__init__(f"{pointer or '/'}: {message}")
        self.pointer = pointer
        self.detail = message
