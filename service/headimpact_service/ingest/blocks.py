"""Cells of a column that part its rows as impacts are parted: in blocks of one value each, or counting anew."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, groupby, pairwise

import numpy as np

from headimpact_service.ingest.cells import is_written_number, numbers_said, said
from headimpact_service.ingest.spelling import words_of

_WITH_PARTS = re.compile(r"[+-]?[0-9]*+\.0*+[1-9][0-9]*+([eE][+-]?[0-9]+)?")
_PHASES = frozenset(
    {
        *("pre", "post", "before", "during", "after", "pretrigger", "posttrigger", "trigger", "triggered", "impact"),
        *("baseline", "rest", "idle", "active", "inactive", "on", "off", "begin", "start", "end", "rise", "decay"),
    }
)
"""Words for the parts of one impact's record."""
_YES_OR_NO = ({"0", "1"}, {"true", "false"}, {"yes", "no"}, {"y", "n"}, {"t", "f"}, {"t", "n"})
SHORTEST = 3
"""Samples of an impact."""
STAY = 10
"""What is no time and stays for so many rows on average is none of the samples'."""
STAY_AS_NAME = 20
"""So many rows and more a decimal stays that is the number of a trial, and no measured value of a slow sensor."""
LONG = 50
"""The same of a decimal, or anything else, in a column whose heading says nothing."""
NEARLY = 1.1
"""How far long blocks may differ in length that are records of one device, of which samples were lost."""


def begins_anew(cells: Sequence[str]) -> bool:
    """Whether numbers of samples stand still or go back to one that was before, or are names that stay for many."""
    told = numbers_said(cells)
    if not told:
        return lie_in_blocks(cells)
    return any(after <= before for before, after in pairwise(told)) and len(set(told)) > 1


def are_several(cells: Sequence[str]) -> bool:
    """Whether a column names more than one thing: not one that is measured, nor one that numbers its rows."""
    told = list(filter(None, map(said, cells)))
    distinct = set(told)
    if _are_yes_or_no(distinct) and sum(a != b for a, b in pairwise(told)) > 1:
        return False  # a mark that came and went
    return 1 < len(distinct) < len(cells) and not any(map(_WITH_PARTS.fullmatch, distinct))


def are_named_apart(cells: Sequence[str]) -> bool:
    """The same where nothing else would tell: names may be decimals, as numbers of trials are (3.1, 3.2)."""
    return are_several(cells) or len(_lengths(cells, STAY_AS_NAME)) > 1


def number_impacts(cells: Sequence[str]) -> bool:
    """Whether a column of a word for impacts has a whole number for each of some, or a name of its own in each row."""
    told = list(filter(None, map(said, cells)))
    distinct = set(told)
    if len(told) > SHORTEST and len(distinct) == len(cells):
        return not any(map(_WITH_PARTS.fullmatch, distinct))
    numbers = numbers_said(list(distinct))
    return len(numbers) == len(distinct) and are_several(cells) and not _are_yes_or_no(distinct)


def tell_parts(cells: Sequence[str]) -> bool:
    """Whether a column parts its rows as impacts are parted, whatever it is called: in blocks, or counting anew."""
    return lie_in_blocks(cells) or lie_in_long_blocks(cells) or _count_up(_blocks(cells)) or _counts_anew(cells)


def tell_parts_or_name_them(cells: Sequence[str]) -> bool:
    """The same, also of words that each name many rows, in all of them or, as merged cells are saved, in the first."""
    if tell_parts(cells):
        return True
    filled = _filled(cells)
    if filled[:1] == [""]:
        return False
    named = _lengths(filled, STAY)
    words = len(named) > 1 and not any(map(is_written_number, named)) and not _are_yes_or_no(named)
    if words and not any(_PHASES & set(words_of(name)) for name in named):
        return True
    return "" in map(said, cells) and tell_parts(filled)


def count_triggers(cells: Sequence[str]) -> bool:
    """The same of a number of triggers, of which yes and no are none."""
    return not _are_yes_or_no(set(map(said, cells))) and tell_parts(cells)


def mark_blocks(cells: Sequence[str]) -> bool:
    """Whether marks, of which yes and no are none, lie in blocks as names of impacts do."""
    return not _are_yes_or_no(set(map(said, cells))) and (lie_in_blocks(cells) or lie_in_long_blocks(cells))


def peaks_lie_in_blocks(cells: Sequence[str]) -> bool:
    """Whether a column of peaks has several that stay, in all rows of theirs or in the first: one an impact."""
    return len(_lengths(_filled(cells), STAY)) > 1


def _filled(cells: Sequence[str]) -> list[str]:
    """What each row says or, where it says nothing, the last one above that does."""
    return list(accumulate(map(said, cells), _carried))


def _carried(above: str, cell: str) -> str:
    return cell or above


def lie_in_blocks(cells: Sequence[str]) -> bool:
    """Whether every value has rows of its own that follow each other, and two have as many, as names of impacts do."""
    return _two_are_equal(_blocks(cells))


def lie_in_long_blocks(cells: Sequence[str]) -> bool:
    """Whether values, measured ones too, have many rows each, and two as many, or three and more nearly as many."""
    blocks = _lengths(cells, LONG)
    return not _are_yes_or_no(blocks) and (_two_are_equal(blocks) or _are_nearly_equal(blocks))


def _two_are_equal(blocks: Mapping[str, int]) -> bool:
    return len(set(blocks.values())) < len(blocks)


def _are_nearly_equal(blocks: Mapping[str, int]) -> bool:
    return len(blocks) > 2 and max(blocks.values()) <= NEARLY * min(blocks.values())


def _are_yes_or_no(values: Iterable[str]) -> bool:
    return {value.lower() for value in values} in _YES_OR_NO


def _counts_anew(cells: Sequence[str]) -> bool:
    """Whether a column counts its rows one by one and begins at its first number again, as a data frame's index may."""
    steps = np.diff(told) if (told := numbers_said(cells)) and len(told) == len(cells) else np.empty(0)
    again = steps != 1.0
    return bool(again.any() and 3 * again.sum() <= again.size and (np.array(told)[1:][again] == told[0]).all())


def _blocks(cells: Sequence[str]) -> dict[str, int]:
    """The same as :func:`_lengths` of an impact's samples and more, of values none of which is measured."""
    lengths = _lengths(cells, SHORTEST)
    return {} if any(map(_WITH_PARTS.fullmatch, lengths)) else lengths


def _lengths(cells: Sequence[str], shortest: int) -> dict[str, int]:
    """How many rows each value has, where they follow each other; none where a value comes back or has fewer rows."""
    lengths: dict[str, int] = {}
    for text, run in groupby(map(said, cells)):
        length = sum(1 for _ in run)
        if length < shortest or not text or text in lengths:
            return {}
        lengths[text] = length
    return lengths


def _count_up(blocks: Mapping[str, int]) -> bool:
    """Whether values count up one by one, each for many rows, however many these are: three, or 1 and 2 for more."""
    told = numbers_said(list(blocks))
    if len(told) < len(blocks) or set(np.diff(told)) != {1.0}:
        return False
    shortest = min(blocks.values())
    return shortest >= STAY if len(told) > 2 else told == [1.0, 2.0] and shortest >= LONG
