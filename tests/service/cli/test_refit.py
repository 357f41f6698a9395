"""`headimpact refit`: R's results from a table, and a clear answer to every table that allows no fit."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from stats_reference import BY_ID, FOLDER, table

from headimpact.model_document import model_from_text
from headimpact_service.cli import refit as command

Run = Callable[..., tuple[int, str, str]]
SHORT = {
    "peak_angular_acceleration": "alpha",
    "delta_angular_velocity": "domega",
    "peak_linear_acceleration": "a",
    "hip3d": "hip",
    "bam": "bam",
}
COLUMNS = {f"{short}_{axis}": f"{key}_{axis}" for key, short in SHORT.items() for axis in "xyz"} | {"y": "outcome"}


def write(path: Path, columns: Mapping[str, Sequence[Any]]) -> Path:
    with path.open("w", newline="") as lines:
        rows = csv.writer(lines)
        rows.writerow(columns)
        rows.writerows(zip(*columns.values(), strict=True))
    return path


def flat_export() -> dict[str, list[str]]:
    """The fixture's 914 impacts under the names of our flat export."""
    return {COLUMNS.get(name, name): cells for name, cells in table("impacts914").items()}


def simulated(n: int = 120, seed: int = 5) -> dict[str, list[Any]]:
    """A small cohort of one criterion."""
    generator = np.random.default_rng(seed)
    bric = generator.gamma(2.0, 0.2, n)
    outcome = (generator.random(n) < 1 / (1 + np.exp(4 - 6 * bric))).astype(int)
    return {"athlete_id": [f"a{i % 20}" for i in range(n)], "outcome": outcome.tolist(), "bric": bric.tolist()}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a refit of the fixture with its own folds and resamples."""
    folder = tmp_path_factory.mktemp("refit")
    options = {"criteria": ("bam", "bric", "hic15", "delta_angular_velocity")}
    request = command.Request(
        options,
        frozenset(),
        FOLDER / "folds_impacts914.csv",
        FOLDER / "bootidx_impacts914.csv",
        "laksari-2020",
        "season-1",
    )
    command.run(write(folder / "table.csv", flat_export()), folder / "out", request)
    return folder / "out"


@pytest.fixture(scope="module")
def report(done: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((done / "report.json").read_text())
    return found


class TestOfTheFixture:
    @pytest.mark.parametrize(
        ("name", "formula"),
        [
            ("bam", "bam_x + bam_y + bam_z"),
            ("bric", "bric"),
            ("hic15", "hic15"),
            ("delta_angular_velocity", "domega_x + domega_y + domega_z"),
        ],
    )
    def test_fits_are_those_of_r(self, report: dict[str, Any], name: str, formula: str) -> None:
        one = report["criteria"][name]
        ml = BY_ID[f"impacts914/ml/y ~ {formula}"]["value"]
        assert list(one["ml_coefficients"].values()) == pytest.approx(ml["coef"], rel=1e-8)
        assert list(one["ml_standard_errors"].values()) == pytest.approx(ml["se"], rel=1e-6)
        served = BY_ID[f"impacts914/prior_bias_unweighted/y ~ {formula}"]["value"]["coef"]
        assert list(one["coefficients"].values()) == pytest.approx(served, rel=1e-8)
        lr = BY_ID[f"impacts914/lr/y ~ {formula}"]["value"]
        assert one["lr_test"]["statistic"] == pytest.approx(lr["lr"], rel=1e-9)
        assert one["lr_test"]["p"] == pytest.approx(lr["p"], rel=1e-7)

    @pytest.mark.parametrize("name", ["bam", "bric", "hic15"])
    def test_validation_is_that_of_r(self, report: dict[str, Any], name: str) -> None:
        one = report["criteria"][name]
        folded = BY_ID[f"impacts914/groupcv/{name}"]["value"]
        assert np.array(one["out_of_fold"]["fold_coefficients"]) == pytest.approx(
            np.array(folded["fold_coef"]), rel=1e-8
        )
        corrected = BY_ID[f"impacts914/optimism/{name}"]["value"]["corrected_auc"]
        assert one["optimism_corrected_auc"] == pytest.approx(corrected, abs=1e-8)
        precision = BY_ID[f"impacts914/boot_ap/{name}"]["value"]
        assert one["average_precision"] == pytest.approx(precision["ap"], rel=1e-10)
        spread = one["bootstrap"]["by_impact"]["average_precision"]
        assert spread["interval"] == pytest.approx(precision["ci95_percentile"], rel=1e-10)

    def test_comparisons_are_those_of_r(self, report: dict[str, Any]) -> None:
        found, expected = report["delong"]["bam_vs_bric"], BY_ID["impacts914/delong/bam_vs_bric"]["value"]
        assert (found["z"], found["p"]) == pytest.approx((expected["z"], expected["p"]), rel=1e-9)
        assert report["bonferroni"] == {"m": 3, "alpha": pytest.approx(0.05 / 3)}

    def test_a_lower_bound_that_27_events_cannot_give_is_null_with_the_reason(self, report: dict[str, Any]) -> None:
        ninety = report["criteria"]["bam"]["thresholds"][1]
        assert ninety["threshold_interval"][0] is None
        assert "36" in ninety["threshold_interval_reason"]

    def test_the_cohort_and_what_stayed_out_are_told(self, report: dict[str, Any]) -> None:
        assert report["cohort"]["n"] == 914
        assert report["cohort"]["events"] == 27
        assert report["cohort"]["athletes"] == 60
        assert report["cohort"]["incidence"] == 0.0055
        assert report["table"] == {"rows": 914, "excluded": {}, "without_athlete": 0, "ignored_columns": ["impact_id"]}

    def test_the_model_says_what_the_report_says(self, done: Path, report: dict[str, Any]) -> None:
        model = model_from_text((done / "model.json").read_bytes())
        assert model.version == "season-1"
        assert [-model.curves["bam"].b0, *(-b for b in model.curves["bam"].b)] == list(
            report["criteria"]["bam"]["coefficients"].values()
        )
        assert model.cohort["digest"] == report["cohort"]["digest"]

    def test_the_page_needs_no_other_host_and_says_what_to_do(self, done: Path) -> None:
        page = (done / "report.html").read_text()
        assert "<script" not in page
        assert "src=" not in page
        assert "url(http" not in page
        assert "<link" not in page
        for told in ("27 concussions leave", "Model card", "not a diagnosis", "sha256:", "more motion lowers"):
            assert told in page
        assert page.count("<svg") >= 12

    def test_what_the_curves_are_stands_below_them(self, done: Path) -> None:
        drawn = next(part for part in (done / "report.html").read_text().split("<svg") if "Precision-recall" in part)
        panels = drawn.split('<g id="axes_')[1:]
        assert len(panels) == 2
        for panel in panels:
            frame, legend = panel.split('<g id="legend_')
            path = re.search(r'<g id="patch_[0-9]+">\s*<path d="([^"]*)"', frame)
            assert path is not None
            bottom = max(map(float, re.findall(r"[ML] \S+ (\S+)", path[1])))
            named = [float(y) for y in re.findall(r'<text [^>]*\by="([0-9.]+)"', legend)]
            assert len(named) == 4
            assert min(named) > bottom

    def test_the_same_table_in_another_order_gives_the_same_numbers(self, tmp_path: Path, run: Run) -> None:
        columns = flat_export()
        order = np.random.default_rng(1).permutation(914)
        write(tmp_path / "a.csv", columns)
        write(tmp_path / "b.csv", {name: [cells[i] for i in order] for name, cells in columns.items()})
        for name in "ab":
            code, _, error = run(
                "refit", "--table", f"{name}.csv", "--out", name, "--criterion", "bric", "--replicas", "20"
            )
            assert (code, error) == (0, "")
        assert (tmp_path / "a/report.json").read_bytes() == (tmp_path / "b/report.json").read_bytes()
        assert (tmp_path / "a/report.html").read_bytes() == (tmp_path / "b/report.html").read_bytes()


class TestTables:
    def test_parquet_is_read_as_csv_is(self, tmp_path: Path, run: Run) -> None:
        columns = simulated()
        write(tmp_path / "t.csv", columns)
        pq.write_table(pa.table(columns), tmp_path / "t.parquet")
        for name in ("csv", "parquet"):
            assert run("refit", "--table", f"t.{name}", "--out", name, "--replicas", "10")[0] == 0
        assert (tmp_path / "csv/report.json").read_bytes() == (tmp_path / "parquet/report.json").read_bytes()

    def test_impacts_without_an_outcome_or_without_consent_stay_out_and_are_counted(
        self, tmp_path: Path, run: Run
    ) -> None:
        columns = simulated()
        words = ["concussion" if outcome else "no_concussion" for outcome in columns["outcome"]]
        columns["outcome"] = ["", "unknown", *words[2:]]
        columns["event"] = ["", "", "false_positive", "unverified", *["verified"] * 116]
        columns["athlete_consent"] = [*["given"] * 4, "withdrawn", *["given"] * 115]
        columns["worn"] = [*["true"] * 5, "false", *[""] * 114]
        write(tmp_path / "t.csv", columns)
        code, printed, _ = run("refit", "--table", "t.csv", "--out", "out", "--replicas", "10")
        assert code == 0
        found = json.loads((tmp_path / "out/report.json").read_text())
        assert found["cohort"]["n"] == 114
        assert found["table"]["excluded"] == {
            "consent_withdrawn": 1,
            "false_positive": 1,
            "no_outcome": 2,
            "not_worn": 1,
            "unverified": 1,
        }
        assert "2 rows left out: no outcome" in printed
        run("refit", "--table", "t.csv", "--out", "out", "--replicas", "10", "--include", "unverified")
        assert json.loads((tmp_path / "out/report.json").read_text())["cohort"]["n"] == 115

    @pytest.mark.parametrize(
        "words", [("FALSE", "TRUE"), ("False", "True"), ("0.0", "1.0"), ("no_concussion", "concussion")]
    )
    def test_tables_of_r_and_of_data_frames_give_the_same_fit(
        self, tmp_path: Path, run: Run, words: tuple[str, str]
    ) -> None:
        """A logical or decimal outcome, and NA where there is no value."""
        columns = simulated()
        columns["hic15"] = [None if i % 7 == 0 else 10.0 + i % 50 for i in range(120)]
        write(tmp_path / "ours.csv", columns)
        columns["outcome"] = [words[outcome] for outcome in columns["outcome"]]
        columns["hic15"] = ["NA" if value is None else value for value in columns["hic15"]]
        write(tmp_path / "theirs.csv", columns)
        fits = []
        for name in ("ours", "theirs"):
            code, _, error = run("refit", "--table", f"{name}.csv", "--out", name, "--replicas", "10")
            assert (code, error) == (0, "")
            fits.append(json.loads((tmp_path / name / "report.json").read_text())["criteria"])
        assert fits[0] == fits[1]

    def test_criteria_joined_by_a_plus_are_fitted_together(self, tmp_path: Path, run: Run) -> None:
        columns = simulated()
        columns["hic15"] = np.random.default_rng(3).gamma(2.0, 20.0, 120).tolist()
        write(tmp_path / "t.csv", columns)
        code, _, error = run(
            "refit", "--table", "t.csv", "--out", "out", "--criterion", "hic15+bric", "--replicas", "10"
        )
        assert (code, error) == (0, "")
        found = json.loads((tmp_path / "out/report.json").read_text())
        assert list(found["criteria"]["hic15+bric"]["coefficients"]) == ["intercept", "hic15", "bric"]
        assert not (tmp_path / "out/model.json").exists()

    @pytest.mark.parametrize(
        ("change", "told"),
        [
            (lambda c: c.pop("outcome"), "no column outcome"),
            (lambda c: c.pop("athlete_id"), "no column athlete_id"),
            (lambda c: c.pop("bric"), "no column of a criterion"),
            (lambda c: c.update(bam_x=c["bric"]), "has bam_x but no bam_y"),
            (lambda c: c.update(outcome=[2, *c["outcome"][1:]]), "Row 2 (the heading is row 1), column outcome"),
            (
                lambda c: c.update(bric=["soft", *c["bric"][1:]]),
                "Row 2 (the heading is row 1), column bric: a finite number",
            ),
            (
                lambda c: c.update(bric=["-inf", *c["bric"][1:]]),
                "Row 2 (the heading is row 1), column bric: a finite number",
            ),
            (
                lambda c: c.update(id=["imp_1", "imp_1", *range(118)], outcome=[0, 0, *c["outcome"][2:]]),
                "Rows 2 and 3 (the heading is row 1): the impact imp_1 stands there twice.",
            ),
            (
                lambda c: c.update(id=["imp_1", "imp_1", *range(118)], outcome=[0, 1, *c["outcome"][2:]]),
                "Rows 2 and 3 (the heading is row 1): the impact imp_1 stands there with the outcomes 0 and 1.",
            ),
            (lambda c: c.update(worn=["perhaps"] * 120), "Row 2 (the heading is row 1), column worn"),
            (lambda c: c.update(outcome=[0] * 120), "none with a concussion"),
            (lambda c: c.update(outcome=[1] * 120), "none without a concussion"),
            (lambda c: c.update(outcome=[""] * 120), "No row of the table enters the cohort (120 no_outcome)"),
            (lambda c: c.update(bric=[""] * 120), "No impact of the cohort has a value of bric"),
            (
                lambda c: c.update(bric=[0.5] * 120),
                "No criterion could be fitted. bric: The predictor has one value in every impact.",
            ),
            (lambda c: c.update(bric=[float(y) for y in c["outcome"]]), "separate"),
        ],
        ids=lambda value: value if isinstance(value, str) else "",
    )
    def test_what_allows_no_fit_is_told_and_nothing_is_written(
        self, tmp_path: Path, run: Run, change: Callable[[dict[str, Any]], Any], told: str
    ) -> None:
        columns = simulated()
        change(columns)
        write(tmp_path / "t.csv", columns)
        code, _, error = run("refit", "--table", "t.csv", "--out", "out", "--replicas", "10")
        assert code == 2
        assert told in error
        assert error.count("\n") == 1
        assert not (tmp_path / "out").exists()

    def test_separated_data_are_fitted_where_firth_is_asked_for(self, tmp_path: Path, run: Run) -> None:
        columns = simulated()
        columns["bric"] = [10 * y + (i % 7) / 10 for i, y in enumerate(columns["outcome"])]
        write(tmp_path / "t.csv", columns)
        code, _, error = run(
            "refit", "--table", "t.csv", "--out", "out", "--replicas", "10", "--bias-correction", "firth"
        )
        assert (code, error) == (0, "")
        one = json.loads((tmp_path / "out/report.json").read_text())["criteria"]["bric"]
        assert one["separation"] == "complete"
        assert one["ml_coefficients"] is None
        assert 0 < one["coefficients"]["value"] < 10

    def test_rows_that_name_no_athlete_are_told(self, tmp_path: Path, run: Run) -> None:
        columns = simulated()
        columns["athlete_id"][:2] = ["", ""]
        write(tmp_path / "t.csv", columns)
        _, printed, _ = run("refit", "--table", "t.csv", "--out", "out", "--replicas", "0")
        told = "2 impacts name no athlete and count each as one of its own"
        assert told in printed
        assert told in (tmp_path / "out/report.html").read_text()
        report = json.loads((tmp_path / "out/report.json").read_text())
        assert (report["table"]["without_athlete"], report["cohort"]["athletes"]) == (2, 22)

    def test_an_incidence_that_a_full_follow_up_does_not_use_is_told(self, tmp_path: Path, run: Run) -> None:
        write(tmp_path / "t.csv", simulated())
        arguments = ("refit", "--table", "t.csv", "--out", "out", "--replicas", "0", "--sampling", "full_follow_up")
        assert "had no effect" not in run(*arguments)[1]
        _, printed, _ = run(*arguments, "--incidence", "0.01", "--incidence-range", "0.001", "0.02")
        assert "The incidence and incidence range had no effect" in printed
        report = json.loads((tmp_path / "out/report.json").read_text())
        assert report["options"]["ignored"] == ["incidence", "incidence_range"]
        assert report["cohort"]["incidence"] == report["cohort"]["share"]
        assert "had no effect" in (tmp_path / "out/report.html").read_text()

    def test_a_range_of_incidences_is_given_as_its_help_shows(self, tmp_path: Path, run: Run) -> None:
        write(tmp_path / "t.csv", simulated())
        assert "--incidence-range <least> <greatest>" in " ".join(run("refit", "--help")[1].split())
        arguments = ("--replicas", "0", "--incidence-range", "0.001", "0.02")
        assert run("refit", "--table", "t.csv", "--out", "out", *arguments)[0] == 0
        found = json.loads((tmp_path / "out/report.json").read_text())
        assert found["options"]["incidence_range"] == [0.001, 0.02]

    def test_a_range_of_incidences_that_does_not_hold_the_incidence_is_refused(self, tmp_path: Path, run: Run) -> None:
        write(tmp_path / "t.csv", simulated())
        arguments = ("--replicas", "0", "--incidence", "0.1", "--incidence-range", "0.001", "0.02")
        code, _, error = run("refit", "--table", "t.csv", "--out", "out", *arguments)
        assert code == 2
        assert "The incidence_range must hold the incidence, 0.1" in " ".join(error.split())

    def test_one_athlete_gives_a_fit_without_figures_by_athlete(self, tmp_path: Path, run: Run) -> None:
        columns = simulated() | {"athlete_id": ["a"] * 120}
        write(tmp_path / "t.csv", columns)
        code, _, error = run("refit", "--table", "t.csv", "--out", "out", "--replicas", "10")
        assert (code, error) == (0, "")
        one = json.loads((tmp_path / "out/report.json").read_text())["criteria"]["bric"]
        assert one["robust_covariance"] is None
        assert one["out_of_fold"]["auc"] is None
        assert one["out_of_fold"]["reason"]
        self.has_no_interval_by_athlete(one)
        assert "Resampling athletes needs" in (tmp_path / "out/report.html").read_text()

    def test_one_athlete_with_all_concussions_gives_no_interval_by_athlete(self, tmp_path: Path, run: Run) -> None:
        columns = simulated()
        columns["athlete_id"] = [
            "hurt" if y else name for y, name in zip(columns["outcome"], columns["athlete_id"], strict=True)
        ]
        write(tmp_path / "t.csv", columns)
        assert run("refit", "--table", "t.csv", "--out", "out", "--replicas", "10")[0] == 0
        self.has_no_interval_by_athlete(json.loads((tmp_path / "out/report.json").read_text())["criteria"]["bric"])

    def has_no_interval_by_athlete(self, one: dict[str, Any]) -> None:
        """No resamples by athlete, and why; those by impact are there."""
        by_athlete, why = one["bootstrap"]["by_athlete"], one["bootstrap"]["by_athlete"]["reason"]
        assert "at least two with a concussion" in why
        assert (by_athlete["replicas"], by_athlete["failed"], by_athlete["auc"]["interval"]) == (0, 0, None)
        assert all(
            found == {"median": None, "sd": None, "interval": None} for found in by_athlete["coefficients"].values()
        )
        assert one["auc"]["bootstrap_interval_by_athlete"] is None
        assert one["auc"]["bootstrap_interval_by_athlete_reason"] == why
        for point in (*one["thresholds"], *one["served_thresholds"]):
            assert point["threshold_interval_bootstrap_by_athlete"] is None
            assert point["threshold_interval_bootstrap_by_athlete_reason"] == why
        assert one["bootstrap"]["by_impact"]["replicas"] == 10
        assert one["bootstrap"]["by_impact"]["reason"] is None
        assert one["auc"]["bootstrap_interval"]


class TestStrain:
    def test_finite_element_results_are_regressed_on_the_brain_angle(self, tmp_path: Path, run: Run) -> None:
        columns = {name: cells for name, cells in flat_export().items() if name != "brain_angle_resultant"}
        bam = np.array([columns[f"bam_{axis}"] for axis in "xyz"], dtype=float).T
        # the axes peak at different times: the largest resultant is not the norm of their peaks
        resultant = np.linalg.norm(bam, axis=1) * np.random.default_rng(1).uniform(0.7, 1.0, len(bam))
        columns["brain_angle_resultant"] = resultant.tolist()
        columns["peak_principal_strain"] = (0.05 + 0.9 * resultant).tolist()
        columns["corpus_callosum_strain"] = [*(0.02 + bam @ np.array([0.3, 0.2, 0.6]))[:-1].tolist(), ""]
        write(tmp_path / "t.csv", columns)
        code, _, error = run("refit", "--table", "t.csv", "--out", "out", "--criterion", "bric", "--replicas", "10")
        assert (code, error) == (0, "")
        strain = json.loads((tmp_path / "out/report.json").read_text())["strain"]
        assert strain["peak_principal_strain"]["coefficients"] == pytest.approx({"intercept": 0.05, "resultant": 0.9})
        callosum = strain["corpus_callosum_strain"]
        assert callosum["n"] == 913
        assert callosum["coefficients"] == pytest.approx({"intercept": 0.02, "x": 0.3, "y": 0.2, "z": 0.6})
        assert callosum["r_squared"] == pytest.approx(1.0)
        assert "corpus callosum strain" in (tmp_path / "out/report.html").read_text()

    def test_strains_without_brain_angles_say_what_is_missing(self, tmp_path: Path, run: Run) -> None:
        columns = simulated() | {"csdm15": [0.1] * 120, "corpus_callosum_strain": [0.1] * 120}
        write(tmp_path / "t.csv", columns)
        run("refit", "--table", "t.csv", "--out", "out", "--replicas", "10")
        strain = json.loads((tmp_path / "out/report.json").read_text())["strain"]
        assert "brain_angle_resultant" in strain["csdm15"]["reason"]
        assert "bam_x" in strain["corpus_callosum_strain"]["reason"]


class TestModels:
    def test_a_model_is_registered_listed_promoted_and_rolled_back(self, done: Path, run: Run) -> None:
        model = str(done / "model.json")
        assert run("models", "add", model) == (0, "season-1: registered\n", "")
        assert run("models", "add", model)[1] == "season-1: was registered already\n"
        assert run("models", "list")[1] == "season-1\nlaksari-2020  active\n"
        _, printed, _ = run("models", "promote", "season-1", "--reason", "Reviewed.")
        assert printed == "season-1 is active; before it was laksari-2020.\n"
        assert run("models", "list")[1] == "season-1  active\nlaksari-2020\n"
        assert run("models", "promote", "laksari-2020", "--reason", "Back.")[0] == 0

    def test_what_is_no_model_or_not_there_is_told(self, tmp_path: Path, run: Run) -> None:
        (tmp_path / "m.json").write_text("{}")
        code, _, error = run("models", "add", "m.json")
        assert (code, "required" in error) == (2, True)
        code, _, error = run("models", "promote", "nobody", "--reason", "x")
        assert (code, error) == (2, "headimpact: There is no such model.\n")


class TestFiles:
    @pytest.mark.parametrize(
        ("name", "content", "told"),
        [
            ("folds", "athlete,fold\na0,1\n", "heading athlete_id,fold"),
            ("folds", "athlete_id,fold\na0,first\n", "Line 2 of the folds"),
            ("folds", "athlete_id,fold\na0,1\na0,2\n", "Line 3 of the folds"),
            ("folds", "athlete_id,fold\na0,1\n", "lack 19 of the cohort's athletes"),
            ("resamples", "0,1,x\n", "Line 1 of the resamples"),
            ("resamples", "0,1,120\n", "row numbers are 0 to 119"),
            ("resamples", "", "resamples is empty"),
        ],
    )
    def test_a_file_that_is_wrong_is_told_with_its_line(
        self, tmp_path: Path, run: Run, name: str, content: str, told: str
    ) -> None:
        write(tmp_path / "t.csv", simulated())
        (tmp_path / "given.csv").write_text(content)
        code, _, error = run("refit", "--table", "t.csv", "--out", "out", f"--{name}", "given.csv")
        assert code == 2
        assert told in error

    @pytest.mark.parametrize(
        ("content", "told"),
        [
            (b"\xff\xfe\x00a", "neither Parquet nor text"),
            (b"\x1f\x8bxyz", "neither Parquet nor text"),
            (b"PAR1nothing", "no readable Parquet"),
            (b"athlete_id,outcome,bric\na,1\n", "Row 2 (the heading is row 1) has 2 cells"),
            (b"athlete_id,outcome,outcome\n", "column outcome twice"),
            (b"", "no column athlete_id"),
        ],
    )
    def test_a_table_that_cannot_be_read_is_told(self, tmp_path: Path, run: Run, content: bytes, told: str) -> None:
        (tmp_path / "t.csv").write_bytes(content)
        code, _, error = run("refit", "--table", "t.csv", "--out", "out")
        assert code == 2
        assert told in error

    def test_rows_are_counted_as_a_spreadsheet_shows_them_past_empty_ones(self, tmp_path: Path, run: Run) -> None:
        (tmp_path / "t.csv").write_text("athlete_id,outcome,bric\na,1,0.5\n\na,0,soft\n")
        code, _, error = run("refit", "--table", "t.csv", "--out", "out")
        assert (code, "Row 4 (the heading is row 1), column bric" in error) == (2, True)

    @pytest.mark.parametrize(
        ("arguments", "told"),
        [
            (("--incidence", "0"), "An incidence must be above 0 and below 1."),
            (("--criterion", "bam2"), "Criteria are:"),
            (("--replicas", "20000"), "Replicas are 0 to 10000."),
            (("--active", "none-such"), "none-such is no published model"),
            (("--active", "t.csv"), "A model's document is JSON."),
        ],
    )
    def test_an_option_out_of_bounds_is_told(
        self, tmp_path: Path, run: Run, arguments: tuple[str, ...], told: str
    ) -> None:
        write(tmp_path / "t.csv", simulated())
        code, _, error = run("refit", "--table", "t.csv", "--out", "out", *arguments)
        assert code == 2
        assert told in error
