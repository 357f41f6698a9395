"""Athletes and devices are read back, changed by revision, and erased for good."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import pytest
from sqlalchemy import func, select

from headimpact_service.errors import Problem
from headimpact_service.store import athletes, devices, ids, impacts, scores
from headimpact_service.store.athletes import AthleteFields
from headimpact_service.store.database import Database
from headimpact_service.store.devices import DeviceFields
from headimpact_service.store.impacts import Impact, ImpactFilters, NewImpact, Outcome
from headimpact_service.store.tables import former_contents


def add(database: Database, data_set: bytes, new: NewImpact, **options: bool) -> Outcome:
    return database.write(lambda conn: impacts.add(conn, data_set, new, **options))


def get(database: Database, data_set: bytes, impact_id: bytes) -> Impact | None:
    with database.read() as conn:
        return impacts.get(conn, data_set, impact_id)


def listed(database: Database, data_set: bytes, filters: ImpactFilters | None = None, **options) -> list[Impact]:
    with database.read() as conn:
        return list(impacts.page(conn, data_set, filters, **options).rows)


class TestErase:
    @pytest.mark.backend("sqlite")
    def test_an_erased_athlete_leaves_nothing_in_the_file(self, database, data_set, make_impact, tmp_path) -> None:
        marked = make_impact("secret-content", external_id="secret-impact", athlete_external_id="secret-athlete")
        marked = replace(marked, session_id="secret-session", device_serial="mg-1")
        mine = add(database, data_set, marked).impact
        other = add(database, data_set, make_impact()).impact
        gone = database.write(lambda conn: athletes.erase(conn, data_set, mine.athlete_id))
        assert gone.deleted_at is not None
        assert gone.external_id is None
        with database.read() as conn:
            assert athletes.get(conn, data_set, mine.athlete_id) is None
            assert athletes.page(conn, data_set, updated_since=mine.created_at).rows[-1] == gone
            assert impacts.get_any(conn, data_set, mine.id).external_id is None
        assert listed(database, data_set) == [other]
        database.checkpoint()
        raw = b"".join(file.read_bytes() for file in tmp_path.iterdir())
        assert b"secret" not in raw
        assert marked.trace not in raw
        assert b"event-1" in raw

    def test_an_erased_impact_is_not_brought_back_by_a_redelivery(self, database, data_set, make_impact) -> None:
        mine = add(database, data_set, make_impact()).impact
        database.write(lambda conn: athletes.erase(conn, data_set, mine.athlete_id))
        with pytest.raises(Problem) as caught:
            add(database, data_set, make_impact())
        assert caught.value.slug == "impact-deleted"

    def test_impacts_deleted_before_lose_their_names_too(self, database, data_set, make_impact) -> None:
        mine = add(database, data_set, make_impact()).impact
        database.write(lambda conn: impacts.delete(conn, data_set, mine.id))
        database.write(lambda conn: athletes.erase(conn, data_set, mine.athlete_id))
        with database.read() as conn:
            assert impacts.get_any(conn, data_set, mine.id).external_id is None

    def test_nothing_stays_by_which_an_erased_athletes_content_is_known(self, database, data_set, make_impact) -> None:
        before, later = (add(database, data_set, make_impact(word, external_id=word)).impact for word in "ab")
        database.write(lambda conn: impacts.delete(conn, data_set, before.id))
        corrected = make_impact("c", external_id="b")
        database.write(lambda conn: impacts.correct(conn, data_set, later.id, corrected))
        kept = select(func.count()).select_from(former_contents)
        with database.read() as conn:
            assert conn.execute(kept).scalar() == 4
        database.write(lambda conn: athletes.erase(conn, data_set, later.athlete_id))
        with database.read() as conn:
            assert conn.execute(kept).scalar() == 0

    def test_revisions_that_were_corrected_to_another_athlete_go_too(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        moved = make_impact("new", athlete_external_id="p-18")
        present = database.write(lambda conn: impacts.correct(conn, data_set, first.id, moved)).impact
        database.write(lambda conn: athletes.erase(conn, data_set, first.athlete_id))
        assert get(database, data_set, first.id) == present
        with database.read() as conn:
            assert [each.revision for each in impacts.revisions(conn, data_set, first.id)] == [2]
            assert scores.list_all(conn, data_set, first.id) == [present.score]
            assert conn.execute(select(func.count()).select_from(former_contents)).scalar() == 0

    def test_many_impacts_get_as_many_instants(self, database, data_set, make_impact) -> None:
        made = [add(database, data_set, make_impact(external_id=str(number))).impact for number in range(20)]
        database.write(lambda conn: athletes.erase(conn, data_set, made[0].athlete_id))
        tombs = listed(database, data_set, updated_since=made[0].updated_at)
        assert len({tomb.updated_at for tomb in tombs}) == len(tombs) == 20
        assert {tomb.id for tomb in tombs} == {impact.id for impact in made}


class TestAthletes:
    FIELDS = AthleteFields(
        external_id="p-1", tags=("a", "b"), sport="hockey", level="u18", position="C", sex="female", birth_year=2009,
        time_zone="Europe/Zurich", consent="granted",
    )  # fmt: skip

    def create(self, database, data_set, new=FIELDS):
        return database.write(lambda conn: athletes.create(conn, data_set, new))

    def patch(self, database, data_set, athlete_id, changes, **options):
        return database.write(lambda conn: athletes.patch(conn, data_set, athlete_id, changes, **options))

    def test_an_athlete_is_read_back(self, database, data_set) -> None:
        made = self.create(database, data_set)
        with database.read() as conn:
            assert athletes.get(conn, data_set, made.id) == made == athletes.find(conn, data_set, "p-1")
            assert athletes.page(conn, data_set, external_id="p-1").rows == (made,)
            assert athletes.page(conn, data_set, external_id="p-2").rows == ()

    def test_a_taken_external_id_conflicts(self, database, data_set) -> None:
        self.create(database, data_set)
        other = self.create(database, data_set, AthleteFields(external_id="p-2"))
        for attempt in (
            lambda: self.create(database, data_set),
            lambda: self.patch(database, data_set, other.id, {"external_id": "p-1"}),
        ):
            with pytest.raises(Problem) as caught:
                attempt()
            assert caught.value.slug == "external-id-conflict"

    def test_a_patch_changes_what_it_names(self, database, data_set) -> None:
        made = self.create(database, data_set)
        changed = self.patch(
            database, data_set, made.id, {"tags": ["c"], "sex": None, "external_id": "p-9"}, if_match=1
        )
        assert changed == replace(
            made, tags=("c",), sex=None, external_id="p-9", revision=2, updated_at=changed.updated_at
        )
        with database.read() as conn:
            assert athletes.get(conn, data_set, made.id) == changed

    def test_a_patch_that_changes_nothing_keeps_the_revision(self, database, data_set) -> None:
        made = self.create(database, data_set)
        assert self.patch(database, data_set, made.id, {"sport": "hockey"}) == made

    def test_a_patch_of_another_revision_is_refused(self, database, data_set) -> None:
        made = self.create(database, data_set)
        with pytest.raises(Problem) as caught:
            self.patch(database, data_set, made.id, {"sport": "x"}, if_match=3)
        assert caught.value.slug == "precondition-failed"

    def test_a_patch_of_what_is_no_field_is_a_mistake(self, database, data_set) -> None:
        made = self.create(database, data_set)
        with pytest.raises(ValueError, match="revision"):
            self.patch(database, data_set, made.id, {"revision": 9})

    def test_nobody_can_be_patched_or_erased(self, database, data_set) -> None:
        for attempt in (
            lambda: self.patch(database, data_set, ids.new(), {}),
            lambda: database.write(lambda conn: athletes.erase(conn, data_set, ids.new())),
        ):
            with pytest.raises(Problem) as caught:
                attempt()
            assert caught.value.slug == "not-found"

    def test_an_erased_athletes_external_id_is_free(self, database, data_set) -> None:
        made = self.create(database, data_set)
        database.write(lambda conn: athletes.erase(conn, data_set, made.id, if_match=1))
        assert self.create(database, data_set).id != made.id


class TestDevices:
    MOUNTING: ClassVar = {
        "accelerometer": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "offset_mm": [1.5, 0, -70.25]}
    }

    def put(self, database, data_set, fields, **options):
        return database.write(lambda conn: devices.put(conn, data_set, "mg-1", fields, **options))

    def test_a_device_is_made_then_replaced_with_a_revision(self, database, data_set) -> None:
        made, created = self.put(database, data_set, DeviceFields(maker="Acme", mounting=self.MOUNTING))
        same, created_again = self.put(database, data_set, DeviceFields(maker="Acme", mounting=self.MOUNTING))
        changed, _ = self.put(database, data_set, DeviceFields(trigger_threshold_g=10.0), if_match=1)
        assert (created, created_again, same) == (True, False, made)
        assert (changed.revision, changed.maker, changed.mounting) == (2, None, None)
        with database.read() as conn:
            assert devices.get(conn, data_set, "mg-1") == changed
            assert devices.page(conn, data_set).rows == (changed,)
            assert devices.page(conn, data_set, serial="mg-2").rows == ()
            assert devices.page(conn, data_set, updated_since=changed.updated_at).rows == (changed,)

    def test_a_change_to_another_revision_is_refused(self, database, data_set) -> None:
        with pytest.raises(Problem):
            self.put(database, data_set, DeviceFields(), if_match=1)
        self.put(database, data_set, DeviceFields())
        with pytest.raises(Problem):
            self.put(database, data_set, DeviceFields(maker="Acme"), if_match=2)

    def test_a_device_made_by_an_impact_can_be_described_later(self, database, data_set, make_impact) -> None:
        impact = add(database, data_set, make_impact(device_serial="mg-1")).impact
        described, created = self.put(database, data_set, DeviceFields(mounting=self.MOUNTING))
        assert (described.id, created, described.mounting) == (impact.device_id, False, self.MOUNTING)
