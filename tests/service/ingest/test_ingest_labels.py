"""What a table says of its impacts beside the samples: names, context, how to read them, their own peaks."""

from __future__ import annotations

import json
from datetime import UTC, datetime

import numpy as np
import pyarrow as pa
import pytest
from binary_files import noise, parquet, wide, xlsx
from hypothesis import given
from hypothesis import strategies as st
from ingest_files import GENERIC, codes, csv_text, one, read, refused, six_axis
from making import MAKERS, columns, motion, resultant

from headimpact.cut_offs import NO_FILTER
from headimpact_service.ingest.file_names import NOT_NAMED, named_facts
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.presets import presets

PREVENT = presets()["prevent"].file_name
MOUNTING = {"accelerometer": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "offset_mm": [70, 0, -10]}}


def labelled(**labels: object) -> str:
    """Quoted as CSV wants it."""
    quoted = {name: '"' + str(value).replace('"', '""') + '"' for name, value in labels.items()}
    return csv_text(before=quoted)


class TestReading:
    def test_an_impact_may_say_how_it_is_to_be_read(self):
        recording = one(
            labelled(
                axes="sae_j211",
                filter="none",
                constrained_plane="sagittal",
                pre_trigger_ms=7.5,
                sample_rate_hz=1001.5,
                mounting=json.dumps(MOUNTING),
                fill_gaps="true",
            )
        ).recording
        assert (recording.axes, recording.low_pass, recording.constrained_plane) == ("sae_j211", NO_FILTER, "sagittal")
        assert (recording.pre_trigger_ms, recording.fill_gaps) == (7.5, True)
        assert recording.linear_acceleration.sample_rate_hz == 1001.5
        assert recording.mounting.offset_m.tolist() == [0.07, 0.0, -0.01]

    def test_a_number_may_have_a_decimal_comma_that_groups_no_thousands(self):
        recording = one(labelled(pre_trigger_ms="7,5", sample_rate_hz="1000,0")).recording
        assert (recording.pre_trigger_ms, recording.linear_acceleration.sample_rate_hz) == (7.5, 1000.0)
        assert codes(refused(labelled(sample_rate_hz="1,000")))[0][0] == "sample_rate_hz"

    def test_a_row_may_say_where_its_signals_were_measured(self):
        assert one(labelled(location="sensor")).needs_device_mounting
        assert one(labelled(location=" Sensor")).needs_device_mounting
        assert not one(labelled(location="head_cg")).needs_device_mounting
        assert not one(labelled(location="Croke Park")).needs_device_mounting
        mounted = one(labelled(location="sensor", mounting=json.dumps(MOUNTING)))
        assert mounted.recording.mounting is not None
        assert not mounted.needs_device_mounting
        contradictory = labelled(location="head_cg", mounting=json.dumps(MOUNTING))
        assert codes(refused(contradictory)) == [("location", "mounting-not-needed")]

    def test_a_filter_may_be_an_object(self):
        recording = one(labelled(filter='{"linear_acceleration": 300, "angular_velocity": "CFC180"}')).recording
        assert (recording.low_pass.linear_acceleration, recording.low_pass.angular_velocity) == (300, "CFC180")

    def test_each_impact_of_a_file_says_its_own(self):
        first = labelled(impact_id="a", filter="none")
        second = labelled(impact_id="b", filter="paper").split("\n", 1)[1]
        assert [r.recording.low_pass.name for r in read(first + second)] == ["none", "paper"]

    def test_what_comes_beside_the_file_counts_more_and_an_empty_cell_says_nothing(self):
        assert one(labelled(axes="sae_j211"), axes="anatomical").recording.axes == "anatomical"
        [(_, signal), *_] = one(
            labelled(filter="none", sample_rate_hz=1000.2), sample_rate_hz=1000.4
        ).recording.signals()
        assert signal.sample_rate_hz == 1000.4
        problem = refused(labelled(sample_rate_hz=1000).replace("t_s", "x"), sample_rate_hz=2000.0)
        assert codes(problem) == [("sample_rate_hz", "rate-differs")]
        assert one(labelled(axes="", filter="", mounting="")).recording.axes == "anatomical"

    @pytest.mark.parametrize(
        ("field", "cell", "code"),
        [
            ("axes", "upside_down", "not-allowed"),
            ("filter", "strong", "not-allowed"),
            ("filter", "{", "not-allowed"),
            ("filter", '{"linear_acceleration": -3}', "out-of-range"),
            ("mounting", "{}", "missing"),
            ("mounting", "left", "wrong-type"),
            ("sample_rate_hz", "fast", "wrong-type"),
            ("sample_rate_hz", "100", "out-of-range"),
            ("sample_rate_hz", "inf", "out-of-range"),
            ("pre_trigger_ms", "-1", "out-of-range"),
            ("constrained_plane", "oblique", "not-allowed"),
        ],
    )
    def test_a_cell_that_breaks_its_rule_is_that_impact_s_422(self, field, cell, code):
        problem = refused(labelled(**{field: cell}))
        assert problem.status == 422
        assert [error.code for error in problem.errors] in ([code], ["not-finite"])
        assert cell == "{" or cell not in problem.detail

    @pytest.mark.parametrize(
        ("heading", "cell", "field"),
        [
            ("Filter", "CFC180", "filter"),
            ("Axes", "SAE", "axes"),
            ("Mounting", "Left ear", "mounting"),
            ("fs", "high", "sample_rate_hz"),
            ("fs", "200", "sample_rate_hz"),
            ("fill_gaps", "perhaps", "fill_gaps"),
        ],
    )
    def test_a_column_that_says_something_else_is_left_alone_where_a_mapping_says_so(self, heading, cell, field):
        text = labelled(**{heading: cell})
        assert f'({{"reading": {{"{field}": null}}}} in a mapping)' in refused(text).detail
        recording = one(text, mapping=Mapping.model_validate({"reading": {field: None}})).recording
        assert (recording.axes, recording.low_pass.name, recording.mounting) == ("anatomical", "paper", None)

    def test_a_field_beside_the_file_stands_in_the_place_of_a_column_that_says_something_else(self):
        text = labelled(filter="CFC180", axes="SAE", sample_rate_hz="high", fill_gaps="perhaps")
        assert "give filter beside the file" in refused(labelled(filter="CFC180")).detail
        assert "beside the file" not in refused(labelled(sample_rate_hz=200)).detail
        given = {"axes": "sae_j211", "low_pass": NO_FILTER, "sample_rate_hz": 1000.0, "fill_gaps": True}
        recording = one(text, **given).recording
        assert (recording.axes, recording.low_pass, recording.fill_gaps) == ("sae_j211", NO_FILTER, True)
        assert codes(refused(labelled(sample_rate_hz=200), **given)) == [("sample_rate_hz", "out-of-range")]
        half = csv_text().splitlines()
        two = [f"{['filter', *['CFC180'] * 20, *['CFC600'] * 20][row]},{line}" for row, line in enumerate(half)]
        assert one("\n".join(two), low_pass=NO_FILTER).recording.low_pass == NO_FILTER

    @pytest.mark.parametrize("cell", ["1000 Hz", "1 kHz", "1kHz", "1,0 kHz", "1000.0 hz", "1000 sps"])
    def test_a_rate_may_name_its_unit(self, cell):
        recording = one(labelled(fs=cell).replace("t_s", "x")).recording
        assert recording.linear_acceleration.sample_rate_hz == 1000.0
        contradicted = refused(labelled(fs="2 kHz"), sample_rate_hz=1000.0)
        assert codes(contradicted) == [("sample_rate_hz", "rate-differs")]

    @pytest.mark.parametrize("cell", ["1,000 Hz", "1 MHz", "1k", "Hz", "1 000 Hz"])
    def test_a_rate_whose_number_or_unit_is_not_clear_is_refused(self, cell):
        assert codes(refused(labelled(fs=cell))) == [("sample_rate_hz", "wrong-type")]

    def test_an_improper_rotation_is_refused(self):
        mirrored = {"accelerometer": MOUNTING["accelerometer"] | {"rotation": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]}}
        assert refused(labelled(mounting=json.dumps(mirrored))).slug == "improper-rotation"

    def test_an_unscorable_record_says_why_and_may_lack_samples(self):
        lines = labelled(unscorable="Channel x failed.").splitlines()
        lines[8] = ",".join([*lines[8].split(",")[:2], "", *lines[8].split(",")[3:]])
        record = one("\n".join(lines))
        assert record.unscorable == ("Channel x failed.",)
        assert np.isnan(record.recording.linear_acceleration.values[7, 0])


class TestContext:
    def test_the_context_comes_from_columns_of_its_names(self):
        record = one(labelled(session_id="s-1", activity="game", worn="false", age_years="17.5", firmware="2.1"))
        assert record.context == {
            "session_id": "s-1",
            "activity": "game",
            "worn": False,
            "age_years": 17.5,
            "firmware": "2.1",
        }

    def test_a_mapping_may_name_others(self):
        mapping = Mapping.model_validate({"context": {"worn": "In mouth", "position": ["Pos", "Role"]}})
        record = one(labelled(**{"In mouth": "0", "Role": "LB"}), mapping=mapping)
        assert record.context == {"worn": False, "position": "LB"}
        problem = refused(csv_text(), mapping=mapping)
        assert codes(problem) == [("/context/worn", "column-missing")]

    @pytest.mark.parametrize(
        ("field", "cell"), [("worn", "perhaps"), ("age_years", "old"), ("sex", "many"), ("level", "a\x07")]
    )
    def test_a_cell_that_breaks_its_rule_is_422_and_names_the_field(self, field, cell):
        problem = refused(labelled(**{field: cell}))
        assert [error.parameter for error in problem.errors] == [field]
        assert cell not in problem.detail

    @pytest.mark.parametrize(
        ("field", "cells"),
        [
            ("worn", [1] * 20 + [0] * 20),
            ("activity", ["run"] * 20 + ["hit"] * 20),
            ("level", [97] * 15 + [96] * 25),
            ("position", [n / 8 for n in range(40)]),
        ],
    )
    def test_a_column_that_says_something_of_each_sample_is_left_alone_where_a_mapping_says_so(self, field, cells):
        first, *lines = csv_text().splitlines()
        text = "\n".join([f"{field},{first}", *(f"{cell},{line}" for cell, line in zip(cells, lines, strict=True))])
        problem = refused(text)
        assert codes(problem) == [(None, "several-impacts")]
        assert f'({{"context": {{"{field}": null}}, "group_by": []}} in a mapping)' in problem.detail
        unread = {"context": {field: None}}
        for mapping in (unread, unread | {"group_by": []}):
            assert one(text, mapping=Mapping.model_validate(mapping)).context == {}
        untimed = text.replace("t_s", "x")
        assert one(untimed, sample_rate_hz=1e3, mapping=Mapping.model_validate(unread | {"group_by": []})).context == {}
        named = text.replace("\n", "\ni1,").replace(field, f"impact_id,{field}", 1)
        assert f'({{"context": {{"{field}": null}}}} in a mapping)' in refused(named).detail
        assert one(named, mapping=Mapping.model_validate(unread)).context == {}

    def test_a_mapping_corrects_single_fields(self):
        text = labelled(worn="false", activity="game", session_id="s-1", sex="M")
        assert '({"context": {"sex": null}} in a mapping)' in refused(text).detail
        record = one(text, mapping=Mapping.model_validate({"context": {"sex": None}}))
        assert record.context == {"worn": False, "activity": "game", "session_id": "s-1"}
        without = one(text, mapping=Mapping.model_validate({"context": {"sex": None, "session_id": None}}))
        assert without.context == {"worn": False, "activity": "game"}
        assert one(text, mapping=Mapping.model_validate({"context": None})).context == {"session_id": "s-1"}


class TestNames:
    @pytest.mark.parametrize("heading", ["Player", "Player ID", "player_id", "Subject", "Subject ID", "athlete_id"])
    def test_an_athlete_is_read_from_any_of_its_names(self, heading):
        assert one(labelled(**{heading: "p-17"})).athlete_external_id == "p-17"

    @pytest.mark.parametrize("heading", ["Device ID", "Serial Number", "sensor_id", "Device Serial Number", "device"])
    def test_a_device_is_read_from_any_of_its_names(self, heading):
        assert one(labelled(**{heading: "mg7"})).device_serial == "mg7"

    @pytest.mark.parametrize("write", ["csv", "parquet", "parquet of text", "xlsx"])
    def test_a_whole_number_that_a_data_frame_made_a_float_is_the_same_name_in_every_format(self, write):
        names = {"external_id": 3.0, "athlete": 7.0, "device": 42.0, "session_id": 2026.0}
        if write == "csv":
            data: str | bytes = labelled(**{name: repr(number) for name, number in names.items()})
        elif write == "xlsx":
            rows = [[*names.values(), index / 1000, *row] for index, row in enumerate(six_axis().tolist())]
            data = xlsx({"a": [[*names, *GENERIC.split(",")], *rows]})
        else:
            table = wide(noise(1)).drop_columns(["external_id"])
            for name, number in names.items():
                table = table.append_column(name, pa.array([repr(number) if "text" in write else number] * 40))
            data = parquet(table)
        record = one(data)
        assert (record.external_id, record.athlete_external_id, record.device_serial) == ("3", "7", "42")
        assert record.context["session_id"] == "2026"

    @pytest.mark.parametrize("name", ["7.5", "007.0", "7.00", "v7.0", "-7.0", "1.0.0", "'quoted", ".0"])
    def test_any_other_name_stays_as_it_is(self, name):
        assert one(labelled(athlete=name)).athlete_external_id == name

    def test_a_version_of_firmware_is_no_whole_number(self):
        assert one(labelled(firmware="2.0")).context == {"firmware": "2.0"}

    def test_an_apostrophe_before_it_keeps_a_name_that_looks_like_a_float(self):
        assert one(labelled(athlete="'7.0")).athlete_external_id == "7.0"

    def test_an_identifier_goes_before_a_name_of_the_same_person(self):
        assert one(labelled(Player="Ann", player_id="p-17")).athlete_external_id == "p-17"


class TestResultants:
    @pytest.mark.parametrize("name", ["prevent", "swa"])
    def test_a_device_s_own_resultants_are_compared(self, name):
        made = MAKERS[name][0]()
        options = {"sample_rate_hz": 1000.0, "occurred_at": datetime(2026, 1, 1, tzinfo=UTC)} if name == "swa" else {}
        assert read(made.data, **options)[0].notes == ()

    def test_one_that_differs_is_named_with_both_numbers(self):
        a = motion(100, 1000.0, 20)["linear_acceleration"]
        wrong = resultant(a).copy()
        wrong[25] += 5.0
        mapping = Mapping.model_validate(
            {
                "linear_acceleration": {"unit": "g", "x": "x", "y": "y", "z": "z", "resultant": "r"},
                "sample_rate_hz": 1000,
            }
        )
        (note,) = one(columns(["x", "y", "z", "r"], [a, wrong]), mapping=mapping).notes
        assert note.code == "vendor_peak_mismatch"
        assert f"{wrong[25]:.5g} g" in note.detail
        assert f"{wrong[25] - 5.0:.5g} g" in note.detail


class TestFileNames:
    @pytest.mark.parametrize(
        "name",
        [
            "MG0042-17-2026-11-20T19:04:05.123Z.csv",
            "MG0042-17-2026-11-20T19-04-05.123Z.csv",
            "mg0042-17-20261120T190405.123Z.csv",
            "MG0042-17-2026-11-20T21_04_05.123+02_00.csv",
            "folder/MG0042-17-2026-11-20 19.04.05,123Z.CSV",
        ],
    )
    def test_device_time_and_name_come_from_a_file_s_name(self, name):
        facts = named_facts(name, PREVENT, None)
        assert facts.device == "0042"
        assert facts.occurred_at == datetime(2026, 11, 20, 19, 4, 5, 123_000, UTC)
        assert facts.external_id == name.rpartition("/")[2].rpartition(".")[0]

    def test_a_local_time_needs_the_zone_beside_the_file(self):
        name = "MG0042-17-2026-11-20T19:04:05.csv"
        assert named_facts(name, PREVENT, None).occurred_at is None
        assert named_facts(name, PREVENT, "Europe/Dublin").occurred_at == datetime(2026, 11, 20, 19, 4, 5, tzinfo=UTC)

    @pytest.mark.parametrize("name", [None, "export.csv", "MG0042.csv", "MG0042-17.csv", "XMG1-2-2026.csv"])
    def test_any_other_name_says_nothing(self, name):
        assert named_facts(name, PREVENT, None) == NOT_NAMED

    @given(st.text(max_size=60))
    def test_no_name_is_a_fault(self, text):
        named_facts(f"MG{text}", PREVENT, "Europe/Dublin")

    def test_a_column_counts_more_than_the_name(self):
        found = motion()
        data = MAKERS["prevent"][0]().data.decode().splitlines()
        data = [f"device,{data[0]}", *(f"mg-7,{line}" for line in data[1:])]
        mapping = Mapping.model_validate({"device": "device"})
        record = one("\n".join(data), filename="MG0042-17-2026-11-20T190405Z.csv", mapping=mapping)
        assert record.device_serial == "mg-7"
        assert found["linear_acceleration"].shape == record.recording.linear_acceleration.values.shape

    def test_only_the_preset_that_says_so_reads_names(self):
        assert one(csv_text(six_axis()), filename="MG0042-17-2026-11-20T190405Z.csv").device_serial is None
