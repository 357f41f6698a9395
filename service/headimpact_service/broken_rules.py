"""What a failed validation is called, in a body as in a parameter: our code, and a sentence that names the bound."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic_core import ErrorDetails

# pydantic's error type -> (our code, the sentence; {…} are bounds that pydantic gives with the error). A bound has all
# of its digits: rounded, it might be the value that is refused.
RULES: Mapping[str, tuple[str, str]] = {
    "missing": ("missing", "This field is required."),
    "extra_forbidden": ("unknown-field", "This field is not known here."),
    "finite_number": ("not-finite", "A number must be finite: NaN and Infinity are refused."),
    "float_type": ("wrong-type", "A number is needed."),
    "float_parsing": ("wrong-type", "A number is needed."),
    "json_invalid": ("not-json", "Text that begins with a brace must be JSON."),
    "int_type": ("wrong-type", "A whole number is needed."),
    "string_type": ("wrong-type", "Text is needed."),
    "bool_type": ("wrong-type", "true or false is needed."),
    "bool_parsing": ("wrong-type", "true or false is needed; 1 and 0 are taken, too."),
    "list_type": ("wrong-type", "A list is needed."),
    "dict_type": ("wrong-type", "An object is needed."),
    "model_type": ("wrong-type", "An object is needed."),
    "model_attributes_type": ("wrong-type", "An object is needed."),
    "too_short": ("too-short", "At least {min_length} entries are needed."),
    "too_long": ("too-long", "At most {max_length} entries are taken."),
    "string_too_short": ("too-short", "The number of characters must be at least {min_length}."),
    "string_too_long": ("too-long", "The number of characters must be at most {max_length}."),
    "string_pattern_mismatch": ("control-character", "Control characters are refused, and blanks alone."),
    "literal_error": ("not-allowed", "One of these is needed: {expected}."),
    "greater_than": ("out-of-range", "A value above {gt:.15g} is needed."),
    "greater_than_equal": ("out-of-range", "A value of at least {ge:.15g} is needed."),
    "less_than": ("out-of-range", "A value below {lt:.15g} is needed."),
    "less_than_equal": ("out-of-range", "A value of at most {le:.15g} is needed."),
    "cut_off_form": ("wrong-type", "A filter is a cut-off in Hz, CFC60, CFC180, CFC600, CFC1000 or null."),
    "filter_form": (
        "wrong-type",
        'A filter is "paper", "none" or an object with a cut-off for each signal, as '
        '{{"linear_acceleration": "CFC180", "angular_velocity": 184}}.',
    ),
}
"""The rules by pydantic's name of the fault: our code, and the sentence."""


def broken_rule(fault: ErrorDetails) -> tuple[str, str]:
    """The code and the sentence of a fault."""
    code, sentence = RULES.get(fault["type"], ("invalid", "The value does not fit here."))
    if fault.get("ctx", {}).get("expected") == "'paper' or 'none'":  # a text may be neither, but an object, too
        sentence = RULES["filter_form"][1]
    if fault["type"] == "value_error":  # raised by a validator of our own, in a sentence of our own
        sentence = "{error}"
    return code, sentence.format_map(fault.get("ctx", {}))
