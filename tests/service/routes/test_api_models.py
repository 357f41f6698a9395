"""/v1/models."""

from __future__ import annotations

import pytest
from sending import Api

from headimpact.criteria import CRITERION_KEYS


class TestModels:
    def test_the_published_model_is_listed(self, api: Api) -> None:
        assert [model["version"] for model in api.get("/v1/models").json()["data"]] == ["laksari-2020"]

    def test_a_model_gives_its_coefficients_and_their_source(self, api: Api) -> None:
        model = api.get("/v1/models/laksari-2020").json()
        assert [curve["criterion"] for curve in model["curves"]] == list(CRITERION_KEYS)
        bam = model["curves"][-1]
        assert (bam["b0"], bam["b"]) == (9.845, [-28.84, -10.23, -37.95])
        assert "Table 3" in model["source"]

    def test_bam_s_operating_points_carry_the_interval_that_rounding_leaves(self, api: Api) -> None:
        points = api.get("/v1/models/laksari-2020").json()["operating_points"]["bam"]
        at_ninety = next(point for point in points if point["sensitivity"] == 0.9)
        assert at_ninety["threshold"] == pytest.approx(0.00784, rel=1e-3)
        assert at_ninety["threshold_interval"] == pytest.approx([0.0075, 0.0082], rel=0.01)

    def test_a_critical_value_that_does_not_exist_is_null_with_the_reason(self, api: Api) -> None:
        curves = api.get("/v1/models/laksari-2020").json()["curves"]
        vtcp = next(curve for curve in curves if curve["criterion"] == "vtcp")
        assert vtcp["critical_values"][0]["value"] is None
        assert vtcp["critical_values"][0]["reason"]

    def test_a_bound_that_is_almost_the_refused_value_is_told_with_all_its_digits(self, api: Api) -> None:
        for value, bound in {"1": "at most 0.999999999", "0": "at least 1e-09"}.items():
            answer = api.get("/v1/models/laksari-2020/risk-map", params={"incidence": value})
            assert (answer.status_code, answer.json()["errors"][0]["detail"]) == (422, f"A value of {bound} is needed.")

    def test_an_unknown_version_is_404(self, api: Api) -> None:
        assert api.get("/v1/models/laksari-2031").status_code == 404
