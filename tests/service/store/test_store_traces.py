"""The trace codec gives back every bit."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from headimpact_service.store import traces
from headimpact_service.store.traces import TraceCodecError

any_bits = arrays(np.uint64, array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=40)).map(
    lambda bits: bits.view(np.float64)
)
single = arrays(np.float32, array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=40)).map(
    lambda values: values.astype(np.float64)
)
decimal = st.tuples(
    arrays(
        np.int64,
        array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=40),
        elements=st.integers(-(2**33), 2**33) | st.integers(-2000, 2000),
    ),
    st.integers(0, 7),
).map(lambda drawn: drawn[0] / 10.0 ** drawn[1])
WAVE = np.sin(np.linspace(0, 6, 300)).reshape(100, 3)


@given(st.dictionaries(st.text(max_size=20), any_bits | single | decimal, max_size=5))
def test_every_bit_of_every_array_comes_back(signals: dict[str, np.ndarray]) -> None:
    decoded = traces.decode(traces.encode(signals))
    assert list(decoded) == list(signals)
    for name, values in signals.items():
        assert decoded[name].dtype == np.float64
        assert decoded[name].shape == values.shape
        assert decoded[name].tobytes() == np.ascontiguousarray(values).tobytes()


@given(st.lists(st.dictionaries(st.sampled_from(["a", "b"]), any_bits | single | decimal), min_size=4, max_size=9))
def test_every_bit_comes_back_of_what_is_encoded_together(items: list[dict[str, np.ndarray]]) -> None:
    twice = [*items, *reversed(items)]
    for signals, encoded in zip(twice, traces.encode_many(twice), strict=True):
        decoded = traces.decode(encoded)
        assert {name: (values.shape, values.tobytes()) for name, values in decoded.items()} == {
            name: (values.shape, np.ascontiguousarray(values).tobytes()) for name, values in signals.items()
        }


@pytest.mark.parametrize("together", [1, 700, 10**6])
def test_impacts_encoded_together_have_the_bytes_of_each(together: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traces, "_TOGETHER", together)
    kinds = [40 * WAVE, np.round(40 * WAVE, 2), np.round(40 * WAVE, 6), WAVE.astype(np.float32).astype(np.float64)]
    items = [{"a": kind * scale, "b": kind[:50]} for kind in kinds for scale in (1.0, 2.0, -1.0)]
    items += [{"a": WAVE[:, 0]}, {}]
    assert traces.encode_many(items) == [traces.encode(signals) for signals in items]


def test_a_strided_view_is_stored_as_its_values() -> None:
    assert np.array_equal(traces.decode(traces.encode({"a": WAVE[::2, ::-1]}))["a"], WAVE[::2, ::-1])


def test_samples_of_single_precision_take_less_than_half_the_bytes() -> None:
    narrow = WAVE.astype(np.float32).astype(np.float64)
    assert len(traces.encode({"a": narrow})) < 0.55 * len(traces.encode({"a": WAVE}))


@pytest.mark.parametrize("digits", [1, 2, 3, 4, 5, 6])
def test_samples_written_with_few_decimals_take_less_than_half_the_bytes(digits: int) -> None:
    assert len(traces.encode({"a": np.round(40 * WAVE, digits)})) < 0.5 * len(traces.encode({"a": 40 * WAVE}))


@pytest.mark.parametrize("value", [-0.0, np.nan, np.inf, 1e-5, 2147.5, -21474.83648, 2.0**31 / 100])
@pytest.mark.parametrize("at", [0, 90])
def test_a_sample_that_is_no_decimal_of_the_others_kind_is_kept_as_it_is(value: float, at: int) -> None:
    changed = np.round(40 * WAVE, 4)
    changed[at, 1] = value
    assert traces.decode(traces.encode({"a": changed}))["a"].tobytes() == changed.tobytes()


def test_a_frame_that_was_written_today_is_read_for_ever() -> None:
    fixed = bytes([2, 1]) + bytes.fromhex("01 04 01 03000000 01000000") + b"a"
    fixed += bytes.fromhex("28b52ffd240c6100000000000000008000203f8040e65215a5")
    assert traces.decode(fixed)["a"].tobytes() == np.array([1.0, -0.0, 2.5]).tobytes()


def test_what_the_first_codec_wrote_is_read_for_ever() -> None:
    fixed = bytes([1, 1]) + bytes.fromhex("01 04 01 03000000 01000000") + b"a"
    fixed += zlib.compress(np.array([1.0, -0.0, 2.5], dtype="<f4").view(np.uint8).reshape(3, 4).T.tobytes())
    assert traces.decode(fixed)["a"].tobytes() == np.array([1.0, -0.0, 2.5]).tobytes()


def test_multiples_that_the_first_codec_wrote_are_read_for_ever() -> None:
    fixed = bytes([1, 1]) + bytes.fromhex("01 12 01 03000000 01000000") + b"a"
    fixed += zlib.compress(np.array([150, -275, 1], dtype="<i4").view(np.uint8).reshape(3, 4).T.tobytes())
    assert traces.decode(fixed)["a"].tolist() == [1.5, -1.25, -1.24]


def test_a_signal_of_three_dimensions_is_refused() -> None:
    with pytest.raises(TraceCodecError, match="dimensions"):
        traces.encode({"a": np.zeros((2, 2, 2))})
    with pytest.raises(TraceCodecError):
        traces.encode_many([{"a": np.zeros((2, 2, 2))}] * 5)


def test_a_name_of_more_than_255_bytes_is_refused() -> None:
    with pytest.raises(TraceCodecError, match="255"):
        traces.encode({"a" * 256: WAVE})


def test_an_unknown_codec_is_refused() -> None:
    with pytest.raises(TraceCodecError, match="codec"):
        traces.decode(b"\x09" + traces.encode({"a": WAVE})[1:])


@pytest.mark.parametrize("damage", [slice(0, 0), slice(0, 1), slice(0, 9), slice(0, 40), slice(0, -5)])
def test_a_truncated_trace_is_refused(damage: slice) -> None:
    with pytest.raises(TraceCodecError, match="damaged"):
        traces.decode(traces.encode({"a": WAVE})[damage])


@pytest.mark.parametrize("at", [-1, -20, -200])
def test_a_byte_that_changed_in_the_samples_is_noticed(at: int) -> None:
    damaged = bytearray(traces.encode({"a": WAVE}))
    damaged[at] ^= 1
    with pytest.raises(TraceCodecError, match="damaged"):
        traces.decode(bytes(damaged))


@pytest.mark.parametrize(("at", "value"), [(3, 5), (4, 3), (5, 101), (5, 99)])
def test_a_table_that_does_not_fit_its_samples_is_refused(at: int, value: int) -> None:
    damaged = bytearray(traces.encode({"a": WAVE}))
    damaged[at] = value
    with pytest.raises(TraceCodecError, match="damaged"):
        traces.decode(bytes(damaged))
