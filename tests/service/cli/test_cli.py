"""The commands of `headimpact`."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from conforming import document
from sending import Api, impact_body, score_body

from headimpact.criteria import CRITERION_KEYS
from headimpact_service.deps import SCOPES
from headimpact_service.pages.problems import as_markdown
from headimpact_service.settings import unknown_variables
from headimpact_service.store import keys
from headimpact_service.store.database import Database

Run = Callable[..., tuple[int, str, str]]

SWA = "Date,Time,Session ID,Player ID,Sensor ID,Impact ID,Sample Num,Linear Acc x g,Linear Acc y g,Linear Acc z g\n"


class TestKeys:
    def test_the_last_line_printed_is_a_key_that_the_service_takes(self, run: Run, tmp_path: Path) -> None:
        code, printed, _ = run(
            "keys", "create", "--organisation", "Leinster", "--scope", "score", "--scope", "impacts:read"
        )
        assert code == 0
        key = printed.splitlines()[-1]
        database = Database(f"sqlite:///{tmp_path / 'headimpact.db'}")
        with database.read() as conn:
            found = keys.find_key(conn, key)
        database.close()
        assert found is not None
        assert (found.organisation_name, found.scopes) == ("Leinster", {"score", "impacts:read"})

    def test_all_is_every_scope_and_an_organisation_is_reused_by_its_name(self, run: Run, tmp_path: Path) -> None:
        made = [
            run("keys", "create", "--organisation", "A", "--scope", "all", "--mode", mode)[1]
            for mode in ("live", "test")
        ]
        database = Database(f"sqlite:///{tmp_path / 'headimpact.db'}")
        with database.read() as conn:
            live, test = (keys.find_key(conn, printed.splitlines()[-1]) for printed in made)
        database.close()
        assert live is not None
        assert test is not None
        assert live.scopes == set(SCOPES)
        assert live.organisation_id == test.organisation_id
        assert live.data_set_id != test.data_set_id

    def test_an_unknown_scope_is_one_line_and_exit_code_2(self, run: Run) -> None:
        code, printed, failed = run("keys", "create", "--organisation", "A", "--scope", "root")
        assert (code, printed, len(failed.splitlines())) == (2, "", 1)

    def test_keys_are_listed_and_revoked(self, run: Run) -> None:
        _, printed, _ = run("keys", "create", "--organisation", "A", "--scope", "score")
        key_id = printed.split()[1]
        assert key_id in run("keys", "list", "--organisation", "A")[1]
        assert run("keys", "revoke", key_id, "--organisation", "A")[0] == 0
        assert run("keys", "revoke", "nonsense", "--organisation", "A")[0] == 2
        assert run("keys", "list", "--organisation", "B")[0] == 2

    def test_a_mistyped_organisation_is_made_by_none_of_the_other_commands(self, run: Run, tmp_path: Path) -> None:
        file = tmp_path / "impact.json"
        file.write_text(json.dumps(impact_body("e-1")))
        assert run("import", str(file))[0] == 0  # the first of all
        for command in (("import", str(file)), ("models", "list"), ("models", "promote", "x", "--reason", "y")):
            code, _, failed = run(*command, "--organisation", "defualt")
            assert (code, "no organisation of that name" in failed) == (2, True), command


class TestScore:
    def test_json_is_the_answer_of_the_api(self, run: Run, api: Api, tmp_path: Path) -> None:
        file = tmp_path / "impact.json"
        file.write_text(json.dumps(impact_body("e-1")))
        code, printed, _ = run("score", str(file), "--json")
        assert code == 0
        assert json.loads(printed) == api.post("/v1/score", json=score_body()).json()

    def test_the_table_shows_every_criterion_on_one_line_of_80_columns(
        self, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("COLUMNS", "80")
        file = tmp_path / "impact.json"
        file.write_text(json.dumps(impact_body("e-1", scale=0.05)))
        code, printed, _ = run("score", str(file))
        assert code == 0
        assert {line.split()[0] for line in printed.splitlines() if line}.issuperset(CRITERION_KEYS)
        assert "…" not in printed
        for words in ("Research use only", "bam at sensitivity"):
            assert words in printed

    def test_several_impacts_are_a_list_and_a_bad_one_is_said_on_standard_error(self, run: Run, tmp_path: Path) -> None:
        file = tmp_path / "impacts.ndjson"
        bad = impact_body("bad")
        del bad["kinematics"]["linear_acceleration"]["unit"]
        file.write_text("\n".join(json.dumps(body) for body in (impact_body("e-0"), bad, impact_body("e-2"))))
        code, printed, failed = run("score", str(file), "--json")
        assert code == 2
        assert len(json.loads(printed)) == 2
        assert failed.startswith("headimpact: impact 1: ")
        assert "/kinematics/linear_acceleration/unit" in failed

    def test_a_table_without_times_needs_its_rate(self, run: Run, tmp_path: Path) -> None:
        file = tmp_path / "swa.csv"
        rows = [f"d,37:10.6,s,p,m,i,{i},{x},1.0,0.5" for i, x in enumerate([0, 5, 40, 55, 30, 8, 1, 0, 0, 0])]
        file.write_text(SWA + "\n".join(rows))
        given = ("score", str(file), "--preset", "swa", "--json", "--occurred-at", "2026-11-20T19:04:05Z")
        assert run(*given)[0] == 2
        code, printed, failed = run(*given, "--sample-rate-hz", "1000")
        assert code == 0, failed
        assert json.loads(printed)["peaks"]["linear_acceleration_g"] > 20

    def test_a_mapping_may_be_in_a_file(self, run: Run) -> None:
        examples = Path(__file__).parents[3] / "openapi" / "examples"
        table, mapping = examples / "import.csv", examples / "mapping.json"
        code, printed, _ = run("score", str(table), "--mapping", f"@{mapping}", "--json")
        assert code == 0
        assert json.loads(printed)["peaks"]["linear_acceleration_g"] > 40

    def test_impacts_without_names_are_headed_by_where_they_stood(self, run: Run, tmp_path: Path) -> None:
        table = (Path(__file__).parents[3] / "openapi" / "examples" / "import.csv").read_text()
        mapping = Path(__file__).parents[3] / "openapi" / "examples" / "mapping.json"
        with zipfile.ZipFile(tmp_path / "two.zip", "w") as archive:
            archive.writestr("first.csv", table)
            archive.writestr("second.csv", table)
        code, printed, failed = run("score", str(tmp_path / "two.zip"), "--mapping", f"@{mapping}")
        assert code == 0, failed
        headings = [line for line in printed.splitlines() if ": scored under" in line]
        assert [heading.split(":")[0] for heading in headings] == ["first.csv", "second.csv"]

    @pytest.mark.parametrize("text", [None, "", "nonsense", "{", "[]"])
    def test_a_file_that_cannot_be_read_is_one_line_and_exit_code_2(
        self, run: Run, tmp_path: Path, text: str | None
    ) -> None:
        file = tmp_path / "file.json"
        if text is not None:
            file.write_text(text)
        code, printed, failed = run("score", str(file))
        assert (code, printed, len(failed.splitlines())) == (2, "", 1)
        assert "Traceback" not in failed

    def test_standard_input_is_read_for_a_dash(self, tmp_path: Path) -> None:
        command = [sys.executable, "-m", "headimpact_service", "score", "-", "--json"]
        given = json.dumps(impact_body()).encode()
        ended = subprocess.run(command, input=given, cwd=tmp_path, capture_output=True, check=True)
        assert json.loads(ended.stdout)["state"] == "scored"


class TestOthers:
    def test_migrate_makes_the_database_and_may_be_run_again(self, run: Run, tmp_path: Path) -> None:
        for _ in range(2):
            code, printed, _ = run("migrate")
            assert (code, "headimpact.db" in printed) == (0, True)
        assert (tmp_path / "headimpact.db").exists()

    def test_openapi_writes_the_document_and_the_list_of_problems(self, run: Run, tmp_path: Path) -> None:
        assert run("openapi", "--output", "a.json", "--problems", "p.md")[0] == 0
        assert json.loads((tmp_path / "a.json").read_text("utf-8")) == document()
        assert (tmp_path / "p.md").read_text("utf-8") == as_markdown()

    def test_help_names_every_command(self, run: Run) -> None:
        code, printed, _ = run("--help")
        assert code == 0
        for command in ("serve", "migrate", "keys", "score", "openapi"):
            assert command in printed

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("HEADIMPACT_DATABASE_URL", "sqlite:///:memory:"),
            ("HEADIMPACT_DATABASE_URL", "x"),
            ("HEADIMPACT_PORT", "no"),
            ("HEADIMPACT_HOST", ""),
        ],
    )
    def test_a_setting_that_cannot_work_is_one_line_and_exit_code_2(
        self, run: Run, monkeypatch: pytest.MonkeyPatch, name: str, value: str
    ) -> None:
        monkeypatch.setenv(name, value)
        code, _, failed = run("migrate")
        assert (code, len(failed.splitlines())) == (2, 1)

    def test_a_fault_of_our_own_is_one_line_and_exit_code_1(self, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
        def fail(*_: object) -> None:
            raise RuntimeError("broken")

        monkeypatch.setattr("headimpact_service.cli.database.migrate", fail)
        assert run("migrate") == (1, "", "headimpact: RuntimeError: broken\n")


class TestImport:
    def test_a_file_is_imported_once_and_each_has_its_line(self, run: Run, tmp_path: Path) -> None:
        file = tmp_path / "impacts.ndjson"
        bad = impact_body("bad")
        del bad["kinematics"]["linear_acceleration"]["unit"]
        file.write_text(
            "\n".join(json.dumps(body) for body in (impact_body("e-0"), bad, impact_body("e-2", scale=0.5)))
        )
        database = f"sqlite:///{tmp_path / 'x.db'}"
        code, printed, _ = run("import", str(file), "--database-url", database)
        assert code == 2
        assert f"{file}: 2 created, 1 failed" in printed
        assert "    bad: " in printed
        code, printed, _ = run("import", str(file), "--database-url", database)
        assert f"{file}: 0 created, 2 unchanged, 1 failed" in printed

    def test_a_folder_is_imported_file_by_file_and_a_broken_one_says_why(self, run: Run, tmp_path: Path) -> None:
        folder = tmp_path / "files"
        folder.mkdir()
        (folder / "a.json").write_text(json.dumps(impact_body("a")))
        (folder / "b.csv").write_text("no,columns\n1,2\n")
        (folder / ".hidden").write_text("nothing")
        code, printed, _ = run("import", str(folder), "--database-url", f"sqlite:///{tmp_path / 'x.db'}")
        assert code == 2
        assert [line.split(": ")[1] for line in printed.splitlines()] == ["1 created", "refused"]

    def test_texts_beside_the_recordings_of_a_folder_are_passed_over(self, run: Run, tmp_path: Path) -> None:
        folder = tmp_path / "files"
        (folder / "more").mkdir(parents=True)
        (folder / "a.json").write_text(json.dumps(impact_body("a")))
        for name in ("README.md", "camlab_LICENSE", "more/notes.pdf"):
            (folder / name).write_text("for people")
        database = f"sqlite:///{tmp_path / 'x.db'}"
        code, printed, _ = run("import", str(folder), "--database-url", database)
        assert code == 0
        said = {line.rsplit("/", 1)[-1] for line in printed.splitlines()}
        over = "passed over, a text beside the recordings"
        assert said == {f"README.md: {over}", f"camlab_LICENSE: {over}", f"notes.pdf: {over}", "a.json: 1 created"}
        code, printed, _ = run("import", str(folder / "README.md"), "--database-url", database)
        assert (code, "refused" in printed) == (2, True)  # who names it means it

    def test_a_dry_run_stores_nothing(self, run: Run, tmp_path: Path) -> None:
        file = tmp_path / "a.json"
        file.write_text(json.dumps(impact_body("a")))
        database = f"sqlite:///{tmp_path / 'x.db'}"
        first, *shown = run("import", str(file), "--dry-run", "--database-url", database)[1].splitlines()
        assert first == f"{file}: 1 readable"
        assert shown[0] == "    a: axes anatomical, athlete p-17, occurred_at 2026-11-20 19:04:05.123000+00:00"
        assert shown[1].startswith("      linear acceleration [g]: 100 samples, 1000 Hz, peaks x ")
        assert "1 created" in run("import", str(file), "--database-url", database)[1]

    def test_what_is_noted_and_which_rules_are_broken_is_said(self, run: Run, tmp_path: Path) -> None:
        marked = impact_body("a", unscorable=["A channel was lost."])
        broken = impact_body("b")
        del broken["kinematics"]["linear_acceleration"]["sample_rate_hz"]
        file = tmp_path / "a.ndjson"
        file.write_text("\n".join(map(json.dumps, (marked, broken))))
        _, printed, _ = run("import", str(file), "--database-url", f"sqlite:///{tmp_path / 'x.db'}")
        first, noted, failed = printed.splitlines()
        assert first == f"{file}: 1 created, 1 failed"
        assert noted == "    noted: not scored (1)"
        assert "/kinematics/linear_acceleration" in failed
        assert "sample_rate_hz" in failed

    def test_a_path_that_is_not_there_has_its_line_and_stops_nothing(self, run: Run, tmp_path: Path) -> None:
        file, missing = tmp_path / "a.json", tmp_path / "none.csv"
        file.write_text(json.dumps(impact_body("a")))
        database = f"sqlite:///{tmp_path / 'x.db'}"
        code, printed, failed = run("import", str(missing), str(file), "--database-url", database)
        assert (code, failed) == (2, "")
        assert printed.splitlines() == [f"{missing}: refused: No such file or directory.", f"{file}: 1 created"]

    def test_a_folder_of_a_crash_test_is_one_set(self, run: Run, tmp_path: Path) -> None:
        folder = tmp_path / "v1"
        folder.mkdir()
        (folder / "v1.EV5").write_text("----- INSTRUMENTATION -----\n----- END -----\n")
        (folder / "v1.001").write_text("0\t1\n")
        _, printed, _ = run("import", str(folder), "--database-url", f"sqlite:///{tmp_path / 'x.db'}")
        assert printed.startswith(f"{folder}: refused")
        assert printed.count("refused") == 1


class TestScoreOfFolders:
    def test_a_folder_of_one_set_is_scored_as_its_zip(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "v1.EV5").write_text("----- INSTRUMENTATION -----\n----- END -----\n")
        code, _, failed = run("score", str(tmp_path))
        assert code == 2
        assert "Is a directory" not in failed

    def test_another_folder_is_said_to_be_one(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "a.csv").write_text("t_s,ax_g\n")
        code, _, failed = run("score", str(tmp_path))
        assert code == 2
        assert failed.startswith(f"headimpact: {tmp_path} is a folder, but not one set of a laboratory")


def test_variables_that_only_look_like_settings_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HEADIMPACT_DATABASE", "sqlite:///x.db")
    monkeypatch.setenv("HEADIMPACT_PORT", "1234")
    [told] = [line for line in unknown_variables() if not line.startswith("HEADIMPACT_RECORDINGS")]
    assert told.startswith("HEADIMPACT_DATABASE is set")
