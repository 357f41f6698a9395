"""Many recordings prepared together: each as if it were alone, whatever else is among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from waveforms import burst, rotation_matrix

from headimpact.cut_offs import NO_FILTER, PAPER, LowPass
from headimpact.errors import TraceError
from headimpact.preparation import BLOCK, Preparation, prepare, prepare_many
from headimpact.recording import Mounting, Recording, Signal
from headimpact.scoring import score, score_many
from headimpact.screening import Screen

MOUNTING = Mounting(
    rotation_matrix([0, 0, 1], 0.3),
    rotation_matrix([1, 1, 0], 1.0),
    np.array([0.07, 0.0, -0.06]),
    gyroscope_delay_s=2e-3,
)
UNITS = {
    "linear_acceleration": (("g", 1.0), ("m/s^2", 9.80665)),
    "angular_velocity": (("rad/s", 1.0), ("deg/s", 180 / np.pi)),
    "angular_acceleration": (("rad/s^2", 1.0), ("deg/s^2", 180 / np.pi)),
}
SCALES = {"linear_acceleration": 40.0, "angular_velocity": 10.0, "angular_acceleration": 900.0}


def spoil(x: np.ndarray, fault: str, scale: float) -> np.ndarray:
    """Samples with something for a rule or a check to find."""
    x = x.copy()
    if fault == "missing":
        x[x.shape[0] // 3, 1] = np.nan
    elif fault == "infinite":
        x[-1, 0] = -np.inf
    elif fault == "beyond":
        x[x.shape[0] // 2, 2] = 1e4 * scale
    elif fault == "extreme":
        x[x.shape[0] // 2, 2] = 9 * scale
    elif fault == "constant":
        x[:, 1] = 0.5
    elif fault == "still":
        x[:] = 0.5
    elif fault == "clipped":
        x[:, 0] = np.clip(x[:, 0], -0.1 * scale, 0.1 * scale)
    elif fault == "glitch":
        x[0, 2] = 0.9 * scale
    return x


FAULTS = ("none", "none", "missing", "infinite", "beyond", "extreme", "constant", "still", "clipped", "glitch")


@st.composite
def signals(draw, name: str, samples: int) -> Signal:
    unit, factor = draw(st.sampled_from(UNITS[name]))
    generator = np.random.default_rng(draw(st.integers(0, 30)))
    x = spoil(burst(generator, samples, SCALES[name]), draw(st.sampled_from(FAULTS)), SCALES[name]) * factor
    declared = draw(st.sampled_from([None, None, 50.0]))
    rate_hz = draw(st.sampled_from([1000.0, 1000.0, 1600.0, 800.0]))
    if draw(st.integers(0, 4)) == 0:
        jitter = generator.uniform(-0.05, 0.05, samples) if draw(st.booleans()) else 0.0
        return Signal(x, unit, time_s=(np.arange(samples) + jitter) / rate_hz, declared_range=declared)
    return Signal(x, unit, rate_hz, declared_range=declared)


@st.composite
def recordings(draw) -> Recording:
    lengths = draw(st.sampled_from([(3,), (40,), (100,), (100,), (100, 60, 99)]))
    names = draw(st.sampled_from([(0, 1), (0, 1), (0, 1, 2), (0,), (1,), (2,), (0, 2)]))
    given_signals = {list(UNITS)[i]: draw(signals(list(UNITS)[i], lengths[i % len(lengths)])) for i in names}
    if draw(st.integers(0, 9)) == 0 and {0, 1} <= set(names):
        sent = given_signals["linear_acceleration"]
        given_signals["angular_velocity"] = replace(sent, values=sent.values / 9, unit="rad/s")
    return Recording(
        **given_signals,
        axes=draw(st.sampled_from(["anatomical", "sae_j211"])),
        mounting=draw(st.sampled_from([None, None, MOUNTING])),
        constrained_plane=draw(st.sampled_from([None, None, None, "sagittal", "axial"])),
        low_pass=draw(st.sampled_from([PAPER, NO_FILTER, LowPass("CFC180", 184.0), LowPass(450.0, "CFC60")])),
        pre_trigger_ms=draw(st.sampled_from([None, 10.0])),
        fill_gaps=draw(st.booleans()),
    )


def alone(recording: Recording) -> Preparation | TraceError:
    try:
        return prepare(recording)
    except TraceError as error:
        return error


def told(found: Preparation | TraceError) -> tuple[object, ...]:
    """Everything that can be told of a preparation or a fault, samples to the bit."""
    if isinstance(found, TraceError):
        return found.code, str(found), found.signal, found.channel, found.index
    motion = found.kinematics.motion
    samples = motion.stack[..., 0].tobytes(order="C")
    sources = (found.angular_velocity_source, found.angular_acceleration_source, found.pre_trigger_known)
    return motion.signals, motion.sample_rate_hz, motion.start_time_ms, samples, found.filters, found.notes, sources


@given(st.lists(recordings(), min_size=1, max_size=12), st.lists(st.integers(0, 11), max_size=12))
@settings(deadline=None, max_examples=150)
def test_each_of_many_is_prepared_to_the_bit_as_it_is_alone(some, again):
    # repeated ones have a layout in common, and so are worked on together
    batch = some + [some[i % len(some)] for i in again]
    assert [told(found) for found in prepare_many(batch)] == [told(alone(one)) for one in batch]


@given(st.lists(recordings(), min_size=1, max_size=6))
@settings(deadline=None, max_examples=150)
def test_what_is_not_looked_at_closely_has_nothing_to_be_found(some):
    quick = [told(found) for found in prepare_many(some)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Screen, "suspects", lambda _, samples: np.ones(samples.shape[0], dtype=bool))
        assert [told(found) for found in prepare_many(some)] == quick


def plain(seed: int) -> Recording:
    generator = np.random.default_rng(seed)
    return Recording(
        Signal(burst(generator, 100, 40.0), "g", 1000.0), Signal(burst(generator, 100, 10.0), "rad/s", 1000.0)
    )


def test_more_than_a_block_is_scored_to_the_bit_as_each_alone():
    batch = [plain(seed) for seed in range(BLOCK + 5)]
    batch[3] = replace(batch[3], angular_velocity=None)
    assert score_many(prepare_many(batch)) == [score(prepare(one)) for one in batch]


def test_some_of_a_block_are_scored_in_any_order():
    prepared = prepare_many([plain(seed) for seed in range(6)])
    chosen = [prepared[i] for i in (4, 0, 3)]
    assert score_many(chosen) == [score(prepare(plain(seed))) for seed in (4, 0, 3)]


def test_a_fault_leaves_the_others_of_its_block_as_they_are():
    batch = [plain(seed) for seed in range(5)]
    sent = batch[2].linear_acceleration
    batch[2] = replace(batch[2], linear_acceleration=replace(sent, values=spoil(sent.values, "missing", 1.0)))
    found = prepare_many(batch)
    assert [isinstance(one, TraceError) for one in found] == [False, False, True, False, False]
    assert found[2].code == "missing-sample"


def test_none_are_prepared_as_none():
    assert prepare_many([]) == []
