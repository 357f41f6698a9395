"""What the sender of a table is told of which no signal was found: what there is, and the remedies that work for it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import is_written_number
from headimpact_service.ingest.headings import layout_problem
from headimpact_service.ingest.options import ImportOptions

CODE = "layout-unknown"
MAX_SHOWN = 12
"""Columns that are named, those that are numbered through as one."""
_NUMBERED = re.compile(r"(.*)_([0-9]{1,4})", re.DOTALL)


def no_signal() -> Problem:
    """The 422 for a table of which no signal was found, before it is known what sort of file it came in."""
    return layout_problem("The columns of no signal were found.", code=CODE)


def is_no_signal(problem: Problem) -> bool:
    """Whether this is what is wrong."""
    return any(error.code == CODE for error in problem.errors)


def with_remedies(
    headings: Sequence[str], options: ImportOptions, format_name: str, single_axes: Sequence[str]
) -> Problem:
    """The same with what helps in this sort of file; `single_axes` are columns of signals that are not whole."""
    named = "" if options.preset is None else f" of the preset {options.preset}"
    remedy = "name a preset, or send a mapping" if options.preset is None else "send a mapping"
    if format_name == "csv" and any(headings) and all(map(is_written_number, filter(None, headings))):
        return layout_problem("The file begins with numbers: write headings above its columns.", code=CODE)
    if single_axes:
        return layout_problem(
            f"No signal has its three axes; the columns {', '.join(single_axes[:MAX_SHOWN])} are some of them. If the "
            'motion was in one plane of the head, say which in a mapping, as {"constrained_plane": "sagittal"}; else '
            "name the columns of the other axes in it.",
            code=CODE,
        )
    asked = f"The columns of no signal{named} were found: {remedy} from columns to signals"
    if format_name == "mat":
        asked += (
            f". The file has the columns {_shown(headings)}; an array impacts x samples x components has one for each "
            "component (permute brings its dimensions into that order). The preset stanford_mat reads an array of six "
            "components, linear acceleration before angular velocity, that is the only one, or structs with fields "
            "lin_acc_CG and ang_vel"
        )
    elif format_name == "csv" and (options.mapping is None or options.mapping.skip_rows is None):
        asked += (
            '. If lines of another kind stand above the headings, a mapping says how many: {"skip_rows": 4} for four'
        )
    return layout_problem(f"{asked}.", code=CODE)


def _shown(headings: Sequence[str]) -> str:
    """The columns, those that are numbered through as their first and last."""
    runs: list[list[str]] = []
    for heading in headings:
        if runs and _follows(heading, runs[-1][-1]):
            runs[-1].append(heading)
        else:
            runs.append([heading])
    names = [run[0] if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs]
    more = f" and {len(names) - MAX_SHOWN} more" if len(names) > MAX_SHOWN else ""
    return ", ".join(names[:MAX_SHOWN]) + more


def _follows(heading: str, before: str) -> bool:
    this, last = _NUMBERED.fullmatch(heading), _NUMBERED.fullmatch(before)
    return this is not None and last is not None and this[1] == last[1] and int(this[2]) == int(last[2]) + 1
