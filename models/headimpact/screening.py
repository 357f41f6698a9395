"""A quick look at the samples of many recordings at once: which of them need a close one.

The rules and checks of single channels are in :mod:`.record_rules` and :mod:`.quality`. Hardly any recording breaks a
rule or earns a note, and to see that takes a tenth of the work: whatever is not suspect here passes all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headimpact.published import QUALITY_LIMITS
from headimpact.quality import Channel, beyond_full_scale, highest_of, near_full_scale
from headimpact.recording import FloatArray

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Screen:
    """What the channels of a layout are looked at for, each bound channels x 1.

    Parameters
    ----------
    extreme
        Magnitudes that earn a note or are refused, or that the sensor cannot show.
    near_full_scale
        Magnitudes near a sensor's declared range, infinite where none is declared.
    linear, rotational
        Channels of linear acceleration, and those of rotation, which cannot be the same numbers.
    """

    extreme: FloatArray
    near_full_scale: FloatArray
    linear: slice
    rotational: slice

    @classmethod
    def of(cls, channels: Sequence[Channel]) -> Screen:
        """The screen of these channels."""
        linear = sum(channel.signal == "linear_acceleration" for channel in channels)  # they come first
        return cls(
            np.array(
                [
                    [min(highest_of(channel.signal, "extreme"), beyond_full_scale(channel.declared_range))]
                    for channel in channels
                ]
            ),
            np.array([[near_full_scale(channel.declared_range)] for channel in channels]),
            slice(linear),
            slice(linear, len(channels)),
        )

    def suspects(self, samples: FloatArray) -> BoolArray:
        """Which of m recordings need a close look: samples m x channels x n, in the criteria's units."""
        highest = np.maximum.reduce(samples, axis=2, keepdims=True)
        lowest = np.minimum.reduce(samples, axis=2, keepdims=True)
        peaks = np.maximum(highest, -lowest)
        suspect = ~(peaks <= self.extreme)  # true for what is no number, too
        suspect |= highest == lowest
        suspect |= self._steps_at_an_edge(samples, peaks)
        suspect |= self._often_at_its_peak(samples, peaks)
        found: BoolArray = np.logical_or.reduce(suspect[..., 0], axis=1)
        found |= self._same_extremes(highest, lowest)
        return found

    def _steps_at_an_edge(self, samples: FloatArray, peaks: FloatArray) -> BoolArray:
        """A first or last step of more than the share of the peak that a glitch has at least."""
        first = np.abs(samples[..., :1] - samples[..., 1:2])
        last = np.abs(samples[..., -1:] - samples[..., -2:-1])
        found: BoolArray = np.maximum(first, last) > QUALITY_LIMITS["edge"]["share_of_peak"] * peaks
        return found

    def _often_at_its_peak(self, samples: FloatArray, peaks: FloatArray) -> BoolArray:
        """As many samples at the peak, or near full scale, as a run has at least."""
        at_peak = np.abs(samples) >= np.minimum(peaks, self.near_full_scale)
        count = np.add.reduce(at_peak, axis=2, keepdims=True)
        found: BoolArray = count >= QUALITY_LIMITS["saturation"]["run"]
        return found

    def _same_extremes(self, highest: FloatArray, lowest: FloatArray) -> BoolArray:
        """A linear and a rotational channel with one largest and one smallest value: m x channels x 1 of each."""
        same = highest[:, self.linear] == highest[:, self.rotational].swapaxes(1, 2)
        same &= lowest[:, self.linear] == lowest[:, self.rotational].swapaxes(1, 2)
        found: BoolArray = np.logical_or.reduce(same, axis=(1, 2))
        return found
