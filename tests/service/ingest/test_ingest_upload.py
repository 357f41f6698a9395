"""What a file is, told by its content."""

from __future__ import annotations

import gzip
import io
import zipfile

import numpy as np
import pytest
from ingest_files import body, csv_text, encoded, one, outcome, read, refused, six_axis, statuses, zipped
from laboratory import iso_mme
from making import prevent

from headimpact_service.errors import Problem
from headimpact_service.ingest import text_tables
from headimpact_service.ingest.detect import Kind, detect
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.stamps import nominal_rate
from headimpact_service.ingest.upload import READERS


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (zipped({"a": "b"}), Kind.ZIP),
        (zipped({}), Kind.ZIP),
        (b' \n {"a": 1}', Kind.JSON),
        (b'\xef\xbb\xbf[{"a": 1}]', Kind.JSON),
        (b'{"a": 1}\n{"a": 2}\n', Kind.NDJSON),
        (b'{"a": 1}\r\n\r\n{"a": 2}', Kind.NDJSON),
        (b'{"a":\n {"b": 1}\n}', Kind.JSON),
        (b"a,b\n1,2\n", Kind.CSV),
        (b"\xe9,b\n1,2\n", Kind.CSV),
        (b"PAR1" + b"\0" * 8, Kind.PARQUET),
        (b"ARROW1\0\0", Kind.ARROW),
        (b"\xff\xff\xff\xff\x10\0\0\0", Kind.ARROW),
        (b"MATLAB 5.0 MAT-file, Platform: x", Kind.MAT),
    ],
)
def test_the_content_tells_the_kind(data: bytes, kind: Kind):
    assert detect(data) is kind
    assert detect(data, filename="misleading.pdf", content_type="image/png") is kind


def test_every_kind_has_its_reader():
    assert set(READERS) == set(Kind)


@pytest.mark.parametrize(
    ("data", "named"),
    [
        (gzip.compress(b"a,b\n", mtime=0), "gzip: unpack it"),
        (b"\x89HDF\r\n\x1a\n", "save it with -v7"),
        (b"\0" * 512 + b"\x89HDF\r\n\x1a\n", "HDF5"),
        (b"MATLAB 7.3 MAT-file, Platform: x", "save it with -v7"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook"),
        (b"%PDF-1.7", "PDF"),
        (b"\x7fELF\0\0\0", "not known"),
        ("a,b\n1,2".encode("utf-16-le"), "not known"),
    ],
)
def test_a_kind_that_is_not_read_is_415_and_named(data: bytes, named: str):
    problem = refused(data)
    assert problem.slug == "unsupported-media-type"
    assert problem.status == 415
    assert named in problem.detail
    assert "CSV" in problem.detail


def test_a_zip_of_something_else_is_415():
    assert refused(zipped({"readme.txt": "hello"})).slug == "unsupported-media-type"
    assert refused(zipped({})).slug == "unsupported-media-type"


def test_a_table_beside_a_laboratorys_test_is_not_passed_over():
    table = csv_text(six_axis())
    with zipfile.ZipFile(io.BytesIO(iso_mme())) as archive:
        members: dict[str, str | bytes] = {name: archive.read(name) for name in archive.namelist()}
    record, problem = read(zipped(members | {"helmet/gyro.csv": table, "report.pdf": b"%PDF"}))
    assert isinstance(record, ImpactRecord)
    assert isinstance(problem, Problem)
    assert (problem.slug, "helmet/gyro.csv was not read" in problem.detail) == ("unsupported-media-type", True)
    assert one(zipped({"gyro.csv": table})).recording.angular_velocity is not None


def test_an_empty_file_is_refused():
    for data in (b"", b"  \n", b"\xef\xbb\xbf"):
        assert refused(data).slug == "unreadable-file"


def test_a_preset_is_known_before_the_file_is_looked_at():
    assert refused(b"", preset="nowhere").slug == "invalid-parameter"


def test_csv_and_json_of_one_impact_give_the_same_signals():
    by_table, by_json = one(csv_text(six_axis())).recording, one(encoded(body())).recording
    for (name, left), (_, right) in zip(by_table.signals(), by_json.signals(), strict=True):
        np.testing.assert_array_equal(left.values, right.values, err_msg=name)
        assert left.sample_rate_hz == right.sample_rate_hz


@pytest.mark.parametrize("rate", [500.0, 1000.0, 1024.0, 1600.0, 3200.0, 10_000.0, 12_500.0, 20_000.0, 100_000.0])
@pytest.mark.parametrize("start", [0.0, -0.05])
def test_stamps_written_in_decimals_say_the_whole_rate(rate: float, start: float):
    stamps = np.array([float(f"{start + i / rate:.10f}") for i in range(400)])
    assert nominal_rate(stamps) == rate


def test_a_rate_that_is_no_whole_number_stays_as_the_stamps_have_it():
    assert nominal_rate(np.arange(100) / 1000.25) == pytest.approx(1000.25, rel=1e-12)


@pytest.mark.parametrize(
    "stamps",
    [
        [],
        [0.0],
        [0.0, 0.0, 0.0],
        [0.0, 2.0, 1.0],
        [2.0, 1.0, 0.0],
        [0.0, 1.0, 2.001],
        [0.0, 1.0, 1.0, 3.0],
        [0.0, float("nan"), 2.0],
        [0.0, 1.0, float("inf")],
        [-1e308, 0.0, 1e308],
    ],
)
def test_stamps_that_are_not_uniform_say_no_rate(stamps: list[float]):
    with np.errstate(all="ignore"):
        assert nominal_rate(np.array(stamps)) is None


class TestFolderOfTables:
    """Files of a device that writes one an impact, in a zip."""

    def test_each_is_read_as_if_it_came_alone(self) -> None:
        data = zipped(
            {
                "session/b.csv": csv_text(2.0 * six_axis()),
                "session/a.csv": csv_text(),
                "session/README.txt": "What this is.",
                "__MACOSX/session/._a.csv": b"\0\5\x16\7",
            }
        )
        found = read(data, athlete="p-1")
        assert [item.metadata["file"] for item in found] == ["session/a.csv", "session/b.csv"]
        assert [item.recording.linear_acceleration.values.max() for item in found] == [
            six_axis()[:, :3].max(),
            2.0 * six_axis()[:, :3].max(),
        ]
        assert {item.athlete_external_id for item in found} == {"p-1"}

    def test_a_device_s_file_name_tells_what_it_tells(self) -> None:
        made = prevent()
        [alone] = read(made.data, filename=made.filename)
        [in_zip] = read(zipped({made.filename: made.data}))
        assert alone.device_serial is not None
        assert (in_zip.device_serial, in_zip.occurred_at) == (alone.device_serial, alone.occurred_at)

    def test_what_is_neither_a_table_nor_about_them_is_named(self) -> None:
        data = zipped({"a.csv": csv_text(), "b.xlsx": b"?", "c/d.json": "{}", "LICENSE": "?", "picture.png": b"?"})
        found = read(data)
        assert [type(item) for item in found] == [ImpactRecord, Problem, Problem]
        assert [item.detail.partition(" ")[0] for item in found[1:]] == ["b.xlsx", "c/d.json"]

    def test_one_that_cannot_be_read_is_refused_alone_and_by_name(self) -> None:
        broken = csv_text().replace("0.005,", "0.005,7,", 1)
        bad, good = read(zipped({"a.csv": broken, "b.csv": csv_text()}))
        assert isinstance(bad, Problem)
        assert bad.detail.startswith("a.csv: The row in line 7 has 8 cells")
        assert isinstance(good, ImpactRecord)

    def test_the_bounds_are_those_of_one_upload(self, monkeypatch: pytest.MonkeyPatch) -> None:
        data = zipped({f"{number}.csv": csv_text() for number in range(3)})
        assert statuses(outcome(data, max_impacts=2)) == {413}
        monkeypatch.setattr(text_tables, "MAX_TABLE", 100)
        assert refused(data).slug == "import-too-large"
