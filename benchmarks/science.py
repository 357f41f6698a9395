"""The science against its peers, side by side in one run.

    OPENBLAS_NUM_THREADS=1 uv run --with eqsig==1.2.17 --with dynars==1.1.0 python benchmarks/science.py

Ratios are the peer's process CPU time over ours, the median over rounds in turn, with the lowest and highest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import straightforward
from alternate import Comparison, compare
from dynars import injury
from eqsig.sdof import nigam_and_jennings_response
from waves import block, fresh, impact

from headimpact.brain import BRAIN, peak_brain_angles
from headimpact.criteria import CRITERIA, evaluate
from headimpact.criteria.windows import window_maxima
from headimpact.kinematics import HeadKinematics
from headimpact.preparation import BLOCK, Preparation, prepare, prepare_many
from headimpact.recording import Recording, Signal
from headimpact.risk import LAKSARI_2020
from headimpact.scoring import score, score_many

RATE = 1000.0


def brain_angles_batch() -> Comparison:
    """1000 impacts of 100 samples; eqsig solves one oscillator of one record a call."""
    impacts = [impact(seed) for seed in range(1000)]
    alpha = np.stack([k.angular_acceleration for k in impacts], axis=2)
    wn = np.sqrt(BRAIN.natural_frequency_squared)
    periods, ratios = 2 * np.pi / wn, np.array(BRAIN.decay_rate) / wn
    some = alpha[:, :, :10]

    def peer():
        return [
            [
                np.abs(nigam_and_jennings_response(some[:, i, m], 1 / RATE, periods[i : i + 1], ratios[i])[0]).max()
                for i in range(3)
            ]
            for m in range(some.shape[2])
        ]

    ours, _ = peak_brain_angles(alpha, RATE)
    # eqsig rounds 2 pi to eight digits, which bounds how far the two can agree
    np.testing.assert_allclose(ours.T[:10], peer(), rtol=1e-6)
    found = compare(lambda: peak_brain_angles(alpha, RATE), peer, calls=(5, 1))
    return impacts_scaled(found, 1000 / some.shape[2])


def impacts_scaled(found: Comparison, factor: float) -> Comparison:
    """The peer ran on a share of the impacts: its cost is proportional to their number."""
    return Comparison(
        found.ours, found.peer * factor, found.ratio * factor, found.lowest * factor, found.highest * factor
    )


def hic_batch() -> Comparison:
    """HIC15 and HIC36 of 1000 impacts of 100 samples at 1 kHz."""
    resultants = np.stack([resultant(impact(seed)) for seed in range(1000)], axis=1)
    rows = [np.ascontiguousarray(column) for column in resultants.T]

    def peer():
        return [(injury.hic15(row, 1 / RATE), injury.hic36(row, 1 / RATE)) for row in rows]

    found = window_maxima(resultants, RATE, (0.015, 0.036)).value
    np.testing.assert_allclose(found.T, [[_value(x) for x in pair] for pair in peer()], rtol=1e-9)
    return compare(lambda: window_maxima(resultants, RATE, (0.015, 0.036)), peer, calls=(3, 3))


def hic_high_rate() -> Comparison:
    """HIC15 and HIC36 of one record of 2000 samples at 20 kHz."""
    record = resultant(impact(3, 2000, 20_000.0))
    column = record[:, None]

    def peer():
        return injury.hic15(record, 1 / 20_000), injury.hic36(record, 1 / 20_000)

    found = window_maxima(column, 20_000.0, (0.015, 0.036)).value[:, 0]
    np.testing.assert_allclose(found, [_value(x) for x in peer()], rtol=1e-9)
    return compare(lambda: window_maxima(column, 20_000.0, (0.015, 0.036)), peer, calls=(50, 20))


def resultant(k: HeadKinematics) -> np.ndarray:
    return np.linalg.norm(k.linear_acceleration_g, axis=1)


def _value(found: object) -> float:
    """dynars gives a value, or a value with its window."""
    return float(found[0]) if isinstance(found, tuple) else float(found)


def prepared(k: HeadKinematics) -> Preparation:
    """Kinematics as the preparation of a recording leaves them."""
    return Preparation(fresh(k.motion), (), (), "supplied", "five_point_stencil", pre_trigger_known=False)


def one_impact(angles: Callable[..., np.ndarray], agreement: float) -> Comparison:
    """All criteria and probabilities of one impact; ours also writes the quality notes and the score object."""
    k = impact(7)
    a, w, alpha = k.linear_acceleration_g, k.angular_velocity, k.angular_acceleration
    ours, peer = score(prepared(k)), straightforward.criteria(a, w, alpha, RATE, angles)
    for criterion in CRITERIA:
        np.testing.assert_allclose(ours.criteria[criterion.key].value, peer[criterion.key], rtol=agreement)
    return compare(
        lambda: score(prepared(k)),
        lambda: straightforward.probabilities(straightforward.criteria(a, w, alpha, RATE, angles)),
        calls=(100, 5),
    )


def batch() -> tuple[float, float]:
    """Impacts per CPU second in batch: values and probabilities as arrays, and whole score objects."""
    impacts = [impact(seed) for seed in range(1024)]
    b0, b = LAKSARI_2020.coefficients
    blocks = [block(impacts[i : i + BLOCK]) for i in range(0, len(impacts), BLOCK)]

    def arrays():
        for motion in blocks:
            values = evaluate(fresh(motion)).values
            for row, criterion in enumerate(CRITERIA):
                found = values[criterion.key].reshape(-1, BLOCK)
                1 / (1 + np.exp(b0[row] + b[row, : len(found)] @ found))

    def objects():
        for motion in blocks:
            one = Preparation(fresh(motion), (), (), "supplied", "five_point_stencil", pre_trigger_known=False)
            score_many([replace(one, place=place) for place in range(BLOCK)])

    both = compare(arrays, objects, calls=(1, 1))
    return len(impacts) / both.ours, len(impacts) / both.peer


def recordings() -> tuple[float, float]:
    """Recordings per CPU second: prepared and scored together, and one by one."""
    sent = [
        Recording(Signal(k.linear_acceleration_g, "g", RATE), Signal(k.angular_velocity, "rad/s", RATE))
        for k in map(impact, range(512))
    ]
    both = compare(
        lambda: score_many(prepare_many(sent)), lambda: [score(prepare(one)) for one in sent], calls=(1, 1), rounds=5
    )
    return len(sent) / both.ours, len(sent) / both.peer


def main() -> None:
    print("| part | peer | ours | peer | ratio, median (range) | to reach |")
    print("|---|---|---|---|---|---|")
    print(brain_angles_batch().row("brain angles, 1000 x 100 samples", "eqsig 1.2.17", "1500"), flush=True)
    print(hic_batch().row("HIC15 + HIC36, 1000 x 100 samples, 1 kHz", "dynars 1.1.0", "1.2"), flush=True)
    print(hic_high_rate().row("HIC15 + HIC36, 2000 samples, 20 kHz", "dynars 1.1.0", "2.5"), flush=True)
    name = "all criteria and probabilities, one impact"
    print(one_impact(straightforward.brain_angles, 1e-9).row(name, "SciPy code with lsim", "30"), flush=True)
    integrated = one_impact(straightforward.brain_angles_by_integration, 1e-4)
    print(integrated.row(name, "SciPy code with solve_ivp", "30"), flush=True)
    arrays, objects = batch()
    print(f"\nIn batch: {arrays:,.0f} impacts per CPU second as arrays, {objects:,.0f} as score objects.")
    together, alone = recordings()
    print(f"From recordings as sent: {together:,.0f} per CPU second together, {alone:,.0f} one by one.")


if __name__ == "__main__":
    main()
