"""Scoring for requests: those that arrive at one moment share its cost."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from anyio.to_thread import run_sync

from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.scoring import DeviceFacts, Scored, Terms, score_record, score_records

MANY_SAMPLES = 4000
"""From here on scoring leaves the event loop: it would hold up every other request for milliseconds."""


@dataclass(frozen=True, slots=True)
class _Waiting:
    """A record, and the request that waits for its score."""

    record: ImpactRecord
    terms: Terms
    device: DeviceFacts
    samples: int
    waiter: asyncio.Future[Scored]


class Scorer:
    """Scores on the event loop what is short, in a thread beside it what is long.

    Of records that are scored together each costs a third, so requests that arrive in the same turn of the loop are.
    None waits for another to arrive, and the digits are the same as alone.
    """

    def __init__(self) -> None:
        """Nothing waits."""
        self._waiting: deque[_Waiting] = deque()

    async def score(self, record: ImpactRecord, terms: Terms, device: DeviceFacts) -> Scored:
        """As :func:`headimpact_service.intake.scoring.score_record`."""
        samples = max((signal.values.shape[0] for _, signal in record.recording.signals()), default=0)
        if samples >= MANY_SAMPLES:
            return await run_sync(partial(score_record, record, terms, device))
        if "traces" in record.include:  # they are answered from the motion, which is let go where many are scored
            return score_record(record, terms, device)
        loop = asyncio.get_running_loop()
        if not self._waiting:
            # two turns: the first reads what has arrived on other connections, the second brings it here
            loop.call_soon(loop.call_soon, self._score_next, loop)
        waiter: asyncio.Future[Scored] = loop.create_future()
        self._waiting.append(_Waiting(record, terms, device, samples, waiter))
        return await waiter

    def _score_next(self, loop: asyncio.AbstractEventLoop) -> None:
        """Score what waits, as much as may hold the loop; the rest in its next turn."""
        by_terms: dict[int, list[_Waiting]] = {}
        samples = 0
        while self._waiting and samples < MANY_SAMPLES:
            one = self._waiting.popleft()
            samples += one.samples
            by_terms.setdefault(id(one.terms), []).append(one)
        if self._waiting:
            loop.call_soon(self._score_next, loop)
        for together in by_terms.values():
            _score(together)


def _score(together: Sequence[_Waiting]) -> None:
    """Answer those who wait for a score under the same terms."""
    for one, result in zip(together, _results(together), strict=True):
        if one.waiter.done():  # its request is gone
            continue
        if isinstance(result, Exception):
            one.waiter.set_exception(result)
        else:
            one.waiter.set_result(result)


def _results(together: Sequence[_Waiting]) -> Sequence[Scored | Exception]:
    """The score of each, or what its request is to raise."""
    if len(together) > 1:
        with suppress(Exception):  # a fault of our own: whose record meets it shows when each is scored alone
            return score_records([(one.record, one.device) for one in together], together[0].terms)
    return [_alone(one) for one in together]


def _alone(one: _Waiting) -> Scored | Exception:
    try:
        return score_record(one.record, one.terms, one.device)
    except Exception as error:
        return error
