"""A club with labelled impacts, made in the database at once: what fits are tried on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from sending import impact_body

from headimpact.calibration import RefitOptions, fitted_model, make_cohort, refit
from headimpact.model_document import model_to_document
from headimpact_service.ingest.digest import content_digest
from headimpact_service.ingest.impact_json import ImpactBody
from headimpact_service.ingest.impact_reading import to_record
from headimpact_service.intake.scoring import UNKNOWN_DEVICE, Terms, score_records
from headimpact_service.intake.storing import new_impact
from headimpact_service.store import impacts, labels
from headimpact_service.store.database import Database
from headimpact_service.store.labels import NewLabel

LOWEST, HIGHEST = 0.3, 3.0


def fill(
    database: Database, data_set_id: bytes, count: int = 120, *, athletes: int = 24, seed: int = 3, first: int = 0
) -> list[bytes]:
    """Impacts of our own wave form in sizes drawn at random, labelled by chance that grows with their size."""
    generator = np.random.default_rng(seed)
    scales = generator.uniform(LOWEST, HIGHEST, (count, 3))
    hurt = generator.random(count) < 1 / (1 + np.exp(6.5 - 2.6 * scales.mean(axis=1)))
    bodies = [_body(first + i, scales[i], athletes) for i in range(count)]
    records = [to_record(ImpactBody.model_validate(body)) for body in bodies]
    scored = score_records([(record, UNKNOWN_DEVICE) for record in records], Terms())
    made: list[bytes] = []

    def store(conn: Any) -> None:
        made.clear()
        for item, concussion in zip(scored, hurt, strict=True):
            new = new_impact(item, content_digest(item.record, item.sent_digest), None)
            impact = impacts.add(conn, data_set_id, replace(new)).impact
            outcome = "concussion" if concussion else "no_concussion"
            labels.put(conn, data_set_id, impact.id, NewLabel(outcome=outcome, basis="follow_up"))
            made.append(impact.id)

    database.write(store)
    return made


def _body(number: int, scale: np.ndarray, athletes: int) -> dict[str, Any]:
    body = impact_body(f"c-{number}", athlete={"external_id": f"p-{number % athletes}"}, context={"sport": "rugby"})
    for name in ("linear_acceleration", "angular_velocity"):
        signal = body["kinematics"][name]
        for axis, factor in zip("xyz", scale, strict=True):
            signal[axis] = [value * factor for value in signal[axis]]
    return body


def spring_document() -> dict[str, Any]:
    """The document of a model that was fitted elsewhere."""
    generator = np.random.default_rng(4)
    bam = generator.gamma(1.5, 0.04, (300, 3))
    hurt = (generator.random(300) < 1 / (1 + np.exp(5 - bam @ np.array([18.0, 12.0, 20.0])))).astype(float)
    cohort = make_cohort(hurt, [f"a{i % 30}" for i in range(300)], {"bam": bam, "bric": bam.sum(axis=1, keepdims=True)})
    return model_to_document(fitted_model(refit(cohort, RefitOptions(replicas=0)), "spring"))
