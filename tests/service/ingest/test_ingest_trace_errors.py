"""What the science refuses, as the answer that a caller gets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from ingest_files import body, codes, encoded, kinematics, signal, six_axis

from headimpact.errors import TraceError
from headimpact.preparation import prepare
from headimpact.recording import Recording
from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_reading import read_impact
from headimpact_service.ingest.trace_errors import trace_problem

STEADY = [float(i) for i in range(40)]


def refusal(**changes: Any) -> Problem:
    record = read_impact(encoded(body(kinematics=kinematics(six_axis(), **changes))))
    with pytest.raises(TraceError) as caught:
        prepare(record.recording)
    return trace_problem(caught.value, record.recording)


def stamped(stamps: list[float]) -> dict[str, Any]:
    return {"angular_velocity": signal("rad/s", six_axis()[:, 3:], time_ms=stamps)}


TIMES = "/kinematics/angular_velocity/time_ms"


@pytest.mark.parametrize(
    ("stamps", "faults"),
    [
        ([*STEADY[:20], *STEADY[19:39]], [(f"{TIMES}/20", "time-not-increasing")]),
        (STEADY[::-1], [(f"{TIMES}/{index}", "time-not-increasing") for index in range(1, 21)]),
        ([0.0, 0.5, *STEADY[2:]], [(f"{TIMES}/1", "time-jitter"), (f"{TIMES}/2", "time-jitter")]),
        ([10.0 * stamp for stamp in STEADY], [("/kinematics/angular_velocity", "sample-rate")]),
        ([1e-300 * stamp for stamp in STEADY], [("/kinematics/angular_velocity", "sample-rate")]),
    ],
)
def test_stamps_that_cannot_be_used_are_pointed_at(stamps: list[float], faults: list[tuple[str, str]]):
    problem = refusal(**stamped(stamps))
    assert (problem.slug, problem.status) == ("invalid-trace", 422)
    assert codes(problem) == faults


def test_every_rule_that_is_broken_is_told_up_to_twenty_faults():
    samples = six_axis()
    samples[7, 1] = samples[9, 2] = -12345.0
    problem = refusal(
        linear_acceleration=signal("g", samples[:, :3], time_ms=[10.0 * stamp for stamp in STEADY]),
        angular_acceleration=signal("rad/s^2", samples[:, 3:], time_ms=[*STEADY[:20], *STEADY[19:39]]),
    )
    assert problem.detail.startswith("The linear acceleration must stay within 1000 g")
    assert codes(problem) == [
        ("/kinematics/linear_acceleration/y/7", "value-out-of-range"),
        ("/kinematics/linear_acceleration/z/9", "value-out-of-range"),
        ("/kinematics/linear_acceleration", "sample-rate"),
        ("/kinematics/angular_acceleration/time_ms/20", "time-not-increasing"),
    ]
    samples[:, 0] = 12345.0
    assert len(refusal(linear_acceleration=signal("g", samples[:, :3])).errors) == 20


def test_a_sample_out_of_range_is_pointed_at_and_its_bound_named_but_not_its_value():
    samples = six_axis()
    samples[7, 1] = 12345.0
    problem = refusal(linear_acceleration=signal("g", samples[:, :3]))
    assert codes(problem) == [("/kinematics/linear_acceleration/y/7", "value-out-of-range")]
    assert "1000 g" in problem.detail
    assert "12345" not in problem.detail


def test_a_record_in_which_nothing_moves_is_refused_as_a_whole():
    still = signal("g", np.ones((40, 3)))
    problem = refusal(linear_acceleration=still, angular_velocity=None)
    assert codes(problem) == [("/kinematics", "constant-signal")]


def test_a_channel_without_a_sample_is_pointed_at():
    error = TraceError("channel", "A channel.", signal="angular_velocity", channel="z")
    assert codes(trace_problem(error, Recording())) == [("/kinematics/angular_velocity/z", "channel")]


def test_an_improper_rotation_has_its_own_problem():
    problem = trace_problem(TraceError("improper-rotation", "The rotation."), Recording())
    assert problem.slug == "improper-rotation"
    assert codes(problem) == [("/kinematics/mounting", "improper-rotation")]


def test_a_lost_sample_is_told_with_what_fills_it_where_that_helps():
    lost = np.delete(six_axis(), 20, axis=0)[:, 3:]
    one_lost = {"angular_velocity": signal("rad/s", lost, time_ms=[*STEADY[:20], *STEADY[21:]])}
    problem = refusal(**one_lost)
    assert codes(problem) == [(f"{TIMES}/20", "time-jitter")]
    assert problem.detail.endswith("; fill_gaps fills gaps of at most 2 samples.")
    prepare(read_impact(encoded(body(kinematics=kinematics(six_axis(), **one_lost, fill_gaps=True)))).recording)
    many = signal("rad/s", six_axis()[:, 3:], time_ms=[*STEADY[:20], *(stamp + 3 for stamp in STEADY[20:])])
    assert "fill_gaps" not in refusal(angular_velocity=many).detail
    jitter = signal("rad/s", six_axis()[:, 3:], time_ms=[0.0, 0.5, *STEADY[2:]])
    assert "fill_gaps" not in refusal(angular_velocity=jitter).detail
    assert "fill_gaps" not in refusal(angular_velocity=jitter, fill_gaps=True).detail


def test_null_among_samples_names_what_fills_it():
    missing = kinematics(six_axis())
    missing["angular_velocity"]["y"][7] = None
    with pytest.raises(Problem) as caught:
        read_impact(encoded(body(kinematics=missing)))
    assert caught.value.errors[0].detail == "A number is needed; fill_gaps fills gaps of at most 2 samples."
