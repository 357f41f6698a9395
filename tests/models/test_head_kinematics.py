"""Differentiation, integration, and the transfer from the sensor to the head's centre of gravity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from waveforms import burst, rotation_matrix

from headimpact.cut_offs import NO_FILTER
from headimpact.kinematics import STANDARD_GRAVITY, HeadKinematics, differentiate, running_integral, transfer_to_head_cg
from headimpact.preparation import prepare
from headimpact.recording import Mounting, Recording, Signal


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_the_derivative_of_a_polynomial_is_exact_up_to_degree_4_inside_and_degree_2_next_to_the_ends(degree):
    # five-point stencil for samples 2 to n-3, central at 1 and n-2, two-point at 0 and n-1
    rate_hz = 100.0
    t = np.arange(40) / rate_hz
    x = np.stack([t**degree, -2 * t**degree, t**degree + 1], axis=1)
    slope = degree * t ** (degree - 1) if degree else np.zeros_like(t)
    exact = np.stack([slope, -2 * slope, slope], axis=1)
    found = differentiate(x, rate_hz)
    np.testing.assert_allclose(found[2:-2], exact[2:-2], rtol=0, atol=1e-12)
    if degree <= 2:
        np.testing.assert_allclose(found[[1, -2]], exact[[1, -2]], rtol=0, atol=1e-12)
    if degree <= 1:
        np.testing.assert_allclose(found[[0, -1]], exact[[0, -1]], rtol=0, atol=1e-12)


@pytest.mark.parametrize("samples", [3, 4, 5, 6, 100])
def test_the_ends_of_the_derivative_are_those_of_numpys_gradient(samples):
    x = np.random.default_rng(1).normal(size=(samples, 3))
    expected = np.gradient(x, 0.001, axis=0)
    found = differentiate(x, 1000.0)
    ends = [0, 1, -2, -1]
    np.testing.assert_allclose(found[ends], expected[ends], rtol=1e-12)


def test_the_stencil_has_the_published_weights():
    # (w[i-2] - 8 w[i-1] + 8 w[i+1] - w[i+2]) / (12 dt)
    impulse = np.zeros((11, 1))
    impulse[5] = 12.0
    np.testing.assert_allclose(differentiate(impulse, 1.0)[:, 0], [0, 0, 0, -1, 8, 0, -8, 1, 0, 0, 0])


@pytest.mark.parametrize("impacts", [None, 2, 16, 40])
def test_the_running_integral_is_that_of_trapezoids_from_zero(impacts):
    # few impacts and many take different ways to it
    shape = (50, 3) if impacts is None else (50, impacts, 3)
    x = np.random.default_rng(1).normal(size=shape)
    found = running_integral(x, 1000.0)
    np.testing.assert_array_equal(found[0], 0)
    for k in (1, 2, 25, 49):
        np.testing.assert_allclose(found[k], np.trapezoid(x[: k + 1], dx=0.001, axis=0), rtol=1e-12, atol=1e-15)


def rigid_body(rate_hz: float, samples: int, offset_m: np.ndarray, inner: int = 40) -> dict[str, np.ndarray]:
    """A head that turns about its centre of gravity, which itself moves along a known path, seen by a sensor on it.

    Orientation R(t) and the centre's path are given in closed form; the sensor's path in the room, c + R r, is
    differentiated twice numerically on `inner` times finer steps. Nothing of the transfer formula is used.
    """
    step = 1 / (rate_hz * inner)
    t = np.arange(-2, samples * inner + 2) * step
    turn = np.stack([0.9 * np.sin(19 * t), 0.6 * np.sin(31 * t + 1), 1.1 * np.sin(23 * t + 2)], axis=1)
    orientation = Rotation.from_euler("ZYX", turn)
    path = np.stack([0.02 * np.sin(70 * t), 0.01 * np.cos(90 * t), 0.015 * np.sin(50 * t)], axis=1)
    sensor = path + orientation.apply(offset_m)

    def second_derivative(x: np.ndarray) -> np.ndarray:
        return (-x[:-4] + 16 * x[1:-3] - 30 * x[2:-2] + 16 * x[3:-1] - x[4:]) / (12 * step**2)

    # angular velocity in head axes from the turning itself: R' = R [w]
    matrix = orientation.as_matrix()
    rate = (matrix[:-4] - 8 * matrix[1:-3] + 8 * matrix[3:-1] - matrix[4:]) / (12 * step)
    skew = np.swapaxes(matrix[2:-2], 1, 2) @ rate
    w = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    inside = Rotation.from_matrix(matrix[2:-2])
    at = slice(0, samples * inner, inner)
    alpha = np.gradient(w, step, axis=0, edge_order=2)
    return {
        "centre": inside.inv().apply(second_derivative(path))[at],
        "sensor": inside.inv().apply(second_derivative(sensor))[at],
        "omega": w[at],
        "alpha": alpha[at],
    }


OFFSET_M = np.array([0.071, -0.013, -0.068])


def moved(a_g: np.ndarray, w: np.ndarray, alpha: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
    """The transfer of one impact, n x 3."""
    return transfer_to_head_cg(a_g[..., None], w[..., None], alpha[..., None], offset_m)[..., 0]


def test_the_transfer_gives_the_acceleration_of_the_centre_of_a_simulated_rigid_body():
    motion = rigid_body(1000.0, 200, OFFSET_M)
    found = moved(motion["sensor"] / STANDARD_GRAVITY, motion["omega"], motion["alpha"], OFFSET_M)
    expected = motion["centre"] / STANDARD_GRAVITY
    assert np.abs(motion["sensor"] - motion["centre"]).max() > 50  # m/s^2: there is something to move
    inner = slice(3, -3)
    np.testing.assert_allclose(found[inner], expected[inner], rtol=0, atol=2e-4 * np.abs(expected).max())


def test_the_opposite_sign_of_the_offset_would_double_the_error_instead():
    # "so does a wrong sign in the CG transfer" change the criteria
    motion = rigid_body(1000.0, 200, OFFSET_M)
    wrong = moved(motion["sensor"] / STANDARD_GRAVITY, motion["omega"], motion["alpha"], -OFFSET_M)
    error = np.abs(wrong - motion["centre"] / STANDARD_GRAVITY).max()
    assert error > 1.9 * np.abs(motion["sensor"] - motion["centre"]).max() / STANDARD_GRAVITY


def test_a_head_that_only_spins_about_its_centre_has_no_acceleration_there():
    samples = 100
    speed = 30.0
    omega = np.tile([0.0, 0.0, speed], (samples, 1))
    sensor = np.tile([-(speed**2) * 0.08, 0.0, 0.0], (samples, 1)) / STANDARD_GRAVITY
    found = moved(sensor, omega, np.zeros((samples, 3)), np.array([0.08, 0.0, 0.0]))
    np.testing.assert_allclose(found, 0, atol=1e-12)


def test_preparation_moves_a_mounted_sensors_signals_to_the_centre_of_gravity_in_head_axes():
    # the same simulated body, seen through a sensor that is turned on the head, gyroscope and accelerometer differently
    motion = rigid_body(5000.0, 600, OFFSET_M, inner=10)
    to_head_a, to_head_w = rotation_matrix([1, 2, 3], 0.8), rotation_matrix([-1, 0.3, 0.2], 2.1)
    recording = Recording(
        Signal(motion["sensor"] @ to_head_a, "m/s^2", 5000.0),  # sensor axes: transpose of the rotation to head axes
        Signal(motion["omega"] @ to_head_w, "rad/s", 5000.0),
        mounting=Mounting(to_head_a, to_head_w, OFFSET_M),
        low_pass=NO_FILTER,
    )
    found = prepare(recording).kinematics
    inner = slice(3, -3)
    np.testing.assert_allclose(found.angular_velocity, motion["omega"], rtol=0, atol=1e-12 * 100)
    np.testing.assert_allclose(found.angular_acceleration[inner], motion["alpha"][inner], rtol=0, atol=0.05)
    expected = motion["centre"] / STANDARD_GRAVITY
    np.testing.assert_allclose(
        found.linear_acceleration_g[inner], expected[inner], rtol=0, atol=1e-3 * np.abs(expected).max()
    )


def test_a_sensor_in_sae_j211_axes_is_mapped_first_then_rotated_and_its_offset_is_anatomical():
    motion = rigid_body(1000.0, 100, OFFSET_M, inner=4)
    mirror = np.array([1.0, -1.0, -1.0])
    # sensor to head, about a skew axis (Rodrigues)
    axis, angle = np.array([2.0, -1.0, 2.0]) / 3.0, 0.7
    cross = np.cross(np.eye(3), axis)
    rotation = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross

    def at_head_cg(sign: np.ndarray, axes: str) -> np.ndarray:
        mounting = Mounting(rotation, rotation, OFFSET_M)
        linear = Signal((motion["sensor"] @ rotation) * sign, "m/s^2", 1000.0)
        angular = Signal((motion["omega"] @ rotation) * sign, "rad/s", 1000.0)
        return prepare(Recording(linear, angular, axes=axes, mounting=mounting)).kinematics.linear_acceleration_g

    np.testing.assert_allclose(at_head_cg(mirror, "sae_j211"), at_head_cg(np.ones(3), "anatomical"), rtol=0, atol=1e-12)


def test_sae_j211_axes_become_anatomical_ones_by_x_minus_y_minus_z():
    # SAE J211: x forward, y right, z down; anatomical: x forward, y left, z up
    generator = np.random.default_rng(1)
    a, w, alpha = burst(generator, 100, 20.0), burst(generator, 100, 5.0), burst(generator, 100, 900.0)
    signals = (Signal(a, "g", 1000.0), Signal(w, "rad/s", 1000.0), Signal(alpha, "rad/s^2", 1000.0))
    found = prepare(Recording(*signals, axes="sae_j211", low_pass=NO_FILTER)).kinematics
    mirror = np.array([1.0, -1.0, -1.0])
    np.testing.assert_array_equal(found.linear_acceleration_g, a * mirror)
    np.testing.assert_array_equal(found.angular_velocity, w * mirror)
    np.testing.assert_array_equal(found.angular_acceleration, alpha * mirror)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_turning_the_signals_and_mounting_them_back_changes_nothing(seed):
    generator = np.random.default_rng(seed)
    to_head = rotation_matrix(generator.normal(size=3), generator.uniform(0, 2 * np.pi))
    plain = Recording(
        Signal(burst(generator, 80, 30.0), "g", 1000.0), Signal(burst(generator, 80, 10.0), "rad/s", 1000.0)
    )
    turned = replace(
        plain,
        linear_acceleration=Signal(plain.linear_acceleration.values @ to_head, "g", 1000.0),
        angular_velocity=Signal(plain.angular_velocity.values @ to_head, "rad/s", 1000.0),
        mounting=Mounting(to_head, to_head, np.zeros(3)),
    )
    found, expected = prepare(turned).kinematics, prepare(plain).kinematics
    for name in ("linear_acceleration_g", "angular_velocity", "angular_acceleration"):
        one, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * np.abs(other).max() + 1e-12)


def test_supplied_angular_acceleration_is_turned_with_the_gyroscope():
    generator = np.random.default_rng(4)
    to_head_a, to_head_w = rotation_matrix([0, 0, 1], 0.4), rotation_matrix([1, 0, 0], 1.2)
    alpha = burst(generator, 100, 900.0)
    recording = Recording(
        angular_acceleration=Signal(alpha, "rad/s^2", 1000.0), mounting=Mounting(to_head_a, to_head_w, np.zeros(3))
    )
    np.testing.assert_allclose(prepare(recording).kinematics.angular_acceleration, alpha @ to_head_w.T, rtol=1e-12)


def test_kinematics_without_a_signal_have_no_samples_and_say_what_is_missing():
    empty = HeadKinematics(1000.0, None, None, None)
    assert empty.samples == 0
    with pytest.raises(ValueError, match="linear_acceleration"):
        empty.motion.of("linear_acceleration")
