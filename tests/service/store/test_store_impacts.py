"""Impacts are stored once, corrected with their past kept, and deleted down to a tombstone."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from hashlib import sha256

import pytest
from sqlalchemy import func, select

from headimpact_service.errors import Problem
from headimpact_service.store import athletes, devices, ids, impact_batches, impact_known, impacts, keys, scores
from headimpact_service.store.athletes import AthleteFields
from headimpact_service.store.database import Database
from headimpact_service.store.impacts import Impact, ImpactFilters, NewImpact, Outcome
from headimpact_service.store.keys import KeyRow
from headimpact_service.store.tables import impact_revisions
from headimpact_service.store.tables import scores as score_table


def add(database: Database, data_set: bytes, new: NewImpact, **options: bool) -> Outcome:
    return database.write(lambda conn: impacts.add(conn, data_set, new, **options))


def get(database: Database, data_set: bytes, impact_id: bytes) -> Impact | None:
    with database.read() as conn:
        return impacts.get(conn, data_set, impact_id)


def listed(database: Database, data_set: bytes, filters: ImpactFilters | None = None, **options) -> list[Impact]:
    with database.read() as conn:
        return list(impacts.page(conn, data_set, filters, **options).rows)


class TestAdd:
    def test_what_is_answered_is_what_is_stored(self, database, key: KeyRow, make_impact) -> None:
        new = make_impact(key_id=key.id)
        outcome = add(database, key.data_set_id, new)
        assert outcome.status == "created"
        assert outcome.impact == get(database, key.data_set_id, outcome.impact.id)
        assert outcome.impact.score.values["bam"] == (0.1, 1 / 3, 1e-7)
        assert outcome.impact.score.quality_codes == ("record_truncated", "low_sample_rate")
        with database.read() as conn:
            (kept,) = impacts.revisions(conn, key.data_set_id, outcome.impact.id)
            assert impacts.trace(conn, key.data_set_id, outcome.impact.id).signals == new.trace
        assert (kept.content_digest, kept.key_id, kept.document) == (new.content_digest, key.id, new.document)

    def test_an_impact_that_says_nothing_of_itself_is_stored(self, database, data_set, make_impact, make_score) -> None:
        names = "external_id athlete_external_id device_serial occurred_at session_id activity sport position context"
        nothing = dict.fromkeys(names.split())
        unscorable = make_score(state="unscorable", values={}, probabilities={}, quality_codes=())
        new = make_impact(**nothing, score=unscorable)
        first, second = add(database, data_set, new).impact, add(database, data_set, new).impact
        assert first == get(database, data_set, first.id)
        assert first.score.values["bam"] is None
        assert second.duplicate_of == first.id

    def test_a_redelivery_is_unchanged(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact())
        again = add(database, data_set, make_impact())
        assert again == Outcome("unchanged", first.impact)

    def test_other_content_under_the_same_external_id_conflicts(self, database, data_set, make_impact) -> None:
        add(database, data_set, make_impact())
        with pytest.raises(Problem) as caught:
            add(database, data_set, make_impact("other"))
        assert caught.value.slug == "external-id-conflict"
        assert len(listed(database, data_set)) == 1

    def test_the_same_external_id_is_free_in_another_data_set(self, database, data_set, make_impact) -> None:
        other = database.write(lambda conn: keys.create_key(conn, "Other", ["all"]))[0].data_set_id
        first = add(database, data_set, make_impact()).impact
        second = add(database, other, make_impact())
        assert second.status == "created"
        assert get(database, other, first.id) is None
        with database.read() as conn:
            assert impacts.trace(conn, other, first.id) is None
            assert impacts.revisions(conn, other, first.id) == []

    def test_an_athlete_and_a_device_are_made_on_first_sight_only(self, database, data_set, make_impact) -> None:
        one = add(database, data_set, make_impact(external_id="1")).impact
        two = add(database, data_set, make_impact(external_id="2")).impact
        assert (one.athlete_id, one.device_id) == (two.athlete_id, two.device_id)
        with database.read() as conn:
            assert athletes.find(conn, data_set, "p-17").id == one.athlete_id
            assert devices.get(conn, data_set, "mg-0042").id == one.device_id

    def test_an_athlete_given_by_id_is_answered_with_the_external_id(self, database, data_set, make_impact) -> None:
        athlete = database.write(lambda conn: athletes.create(conn, data_set, AthleteFields(external_id="x")))
        made = add(database, data_set, make_impact(athlete_id=athlete.id, athlete_external_id=None)).impact
        assert (made.athlete_id, made.athlete_external_id) == (athlete.id, "x")
        assert made == get(database, data_set, made.id)

    def test_an_athlete_id_that_is_none_of_the_data_sets_stores_nothing(self, database, data_set, make_impact) -> None:
        other = database.write(lambda conn: keys.create_key(conn, "Other", ["all"]))[0].data_set_id
        theirs = database.write(lambda conn: athletes.create(conn, other, AthleteFields()))
        for athlete_id in (ids.new(), theirs.id):
            with pytest.raises(Problem) as caught:
                add(database, data_set, make_impact(athlete_id=athlete_id, athlete_external_id=None))
            assert caught.value.slug == "not-found"
            assert caught.value.errors[0].pointer == "/athlete/id"
        assert listed(database, data_set) == []

    def test_the_same_content_is_marked_as_a_duplicate(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact(external_id="1")).impact
        second = add(database, data_set, make_impact(external_id="2")).impact
        assert (first.duplicate_of, second.duplicate_of) == (None, first.id)
        digest = make_impact().input_digest
        with database.read() as conn:
            assert impacts.find_same_content(conn, data_set, digest) == first.id
            assert impacts.find_same_content(conn, data_set, digest, first.id) == second.id
            assert impacts.find_same_content(conn, data_set, b"0" * 32) is None

    def test_an_import_of_the_same_event_is_unchanged_whatever_its_name(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact(external_id="a.csv/1"))
        again = add(database, data_set, make_impact(external_id="b.csv/1"), same_event_is_unchanged=True)
        assert again == Outcome("unchanged", first.impact)

    @pytest.mark.parametrize(
        "change",
        [
            {"athlete_external_id": "p-18"},
            {"athlete_external_id": None},
            {"occurred_at": None},
            {"occurred_at": datetime(2026, 11, 20, tzinfo=UTC)},
            {"input_digest": b"9" * 32},
        ],
    )
    def test_an_import_of_another_event_is_created(self, database, data_set, make_impact, change) -> None:
        add(database, data_set, make_impact(external_id="1"))
        new = make_impact(external_id="2", **change)
        assert add(database, data_set, new, same_event_is_unchanged=True).status == "created"

    def test_an_import_under_a_taken_name_is_not_another_event(self, database, data_set, make_impact) -> None:
        add(database, data_set, make_impact("a", external_id="1"))
        add(database, data_set, make_impact("b", external_id="2"))
        with pytest.raises(Problem) as caught:
            add(database, data_set, make_impact("b", external_id="1"), same_event_is_unchanged=True)
        assert caught.value.slug == "external-id-conflict"

    def test_a_nameless_import_is_found_by_its_content(self, database, data_set, make_impact) -> None:
        new = make_impact(external_id=None, athlete_external_id=None, occurred_at=None)
        add(database, data_set, new)
        assert add(database, data_set, new, same_event_is_unchanged=True).status == "unchanged"


class TestCorrect:
    def correct(self, database, data_set, impact_id, new, if_match=None) -> Outcome:
        return database.write(lambda conn: impacts.correct(conn, data_set, impact_id, new, if_match=if_match))

    def test_a_correction_keeps_the_revision_before(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        corrected = self.correct(database, data_set, first.id, make_impact("new", athlete_external_id="p-18"), 1)
        assert corrected.status == "corrected"
        assert corrected.impact == get(database, data_set, first.id)
        assert (corrected.impact.revision, corrected.impact.athlete_external_id) == (2, "p-18")
        assert corrected.impact.created_at == first.created_at < corrected.impact.updated_at
        with database.read() as conn:
            old, new = impacts.revisions(conn, data_set, first.id)
            assert impacts.trace(conn, data_set, first.id, 1).signals == make_impact().trace
            assert impacts.trace(conn, data_set, first.id).signals == make_impact("new").trace
            assert impacts.trace(conn, data_set, first.id, 3) is None
            assert [each.revision for each in scores.list_all(conn, data_set, first.id)] == [1, 2]
        assert (old.athlete_id, old.superseded_at, new.superseded_at) == (first.athlete_id, new.created_at, None)

    def test_a_redelivery_of_any_kept_revision_is_unchanged(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        present = self.correct(database, data_set, first.id, make_impact("new")).impact
        assert add(database, data_set, make_impact()) == Outcome("unchanged", present)
        assert add(database, data_set, make_impact("new")) == Outcome("unchanged", present)

    def test_a_correction_sent_twice_was_done_once(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        self.correct(database, data_set, first.id, make_impact("new"), 1)
        assert self.correct(database, data_set, first.id, make_impact("new"), 1).status == "unchanged"

    def test_a_correction_of_another_revision_is_refused(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        with pytest.raises(Problem) as caught:
            self.correct(database, data_set, first.id, make_impact("new", athlete_external_id="never-seen"), 2)
        assert caught.value.slug == "precondition-failed"
        assert get(database, data_set, first.id) == first
        with database.read() as conn:
            assert athletes.find(conn, data_set, "never-seen") is None

    def test_equal_content_does_not_hide_another_name_or_revision(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        with pytest.raises(Problem) as caught:
            self.correct(database, data_set, first.id, make_impact(external_id="event-2"), 1)
        assert caught.value.slug == "conflict"
        with pytest.raises(Problem) as caught:
            self.correct(database, data_set, first.id, make_impact(), 7)
        assert caught.value.slug == "precondition-failed"

    def test_what_is_not_there_cannot_be_corrected(self, database, data_set, make_impact) -> None:
        with pytest.raises(Problem) as caught:
            self.correct(database, data_set, ids.new(), make_impact())
        assert caught.value.slug == "not-found"

    def test_a_name_is_kept_and_cannot_be_changed(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        kept = self.correct(database, data_set, first.id, make_impact("new", external_id=None)).impact
        assert kept.external_id == "event-1"
        with pytest.raises(Problem) as caught:
            self.correct(database, data_set, first.id, make_impact("newer", external_id="event-2"))
        assert caught.value.slug == "conflict"

    def test_a_nameless_impact_gets_a_free_name_only(self, database, data_set, make_impact) -> None:
        add(database, data_set, make_impact())
        nameless = add(database, data_set, make_impact("x", external_id=None)).impact
        with pytest.raises(Problem) as caught:
            self.correct(database, data_set, nameless.id, make_impact("y"))
        assert caught.value.slug == "external-id-conflict"
        named = self.correct(database, data_set, nameless.id, make_impact("y", external_id="event-2"))
        assert add(database, data_set, make_impact("y", external_id="event-2")) == Outcome("unchanged", named.impact)

    def test_a_correction_finds_the_duplicates_of_its_new_content(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        second = add(database, data_set, make_impact("other", external_id="2")).impact
        corrected = self.correct(database, data_set, second.id, make_impact(external_id="2")).impact
        assert (second.duplicate_of, corrected.duplicate_of) == (None, first.id)


class TestDelete:
    def test_a_tombstone_says_only_that_something_was_here(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        tomb = database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        assert get(database, data_set, first.id) is None
        assert (tomb.id, tomb.external_id, tomb.athlete_id) == (first.id, first.external_id, first.athlete_id)
        assert (tomb.document, tomb.score, tomb.occurred_at, tomb.session_id, tomb.context) == (None,) * 5
        assert tomb.deleted_at == tomb.updated_at > first.updated_at
        with database.read() as conn:
            assert impacts.get_any(conn, data_set, first.id) == tomb
            for table in (impact_revisions, score_table):
                assert conn.execute(select(func.count()).select_from(table)).scalar() == 0

    def test_a_redelivery_after_a_deletion_is_refused(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        with pytest.raises(Problem) as caught:
            add(database, data_set, make_impact())
        assert caught.value.slug == "impact-deleted"

    def test_only_the_present_revision_is_deleted(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        with pytest.raises(Problem) as caught:
            database.write(lambda conn: impacts.delete(conn, data_set, first.id, if_match=2))
        assert caught.value.slug == "precondition-failed"

    def test_a_second_deletion_finds_nothing(self, database, data_set, make_impact) -> None:
        first = add(database, data_set, make_impact()).impact
        database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        with pytest.raises(Problem) as caught:
            database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        assert caught.value.slug == "not-found"


class TestFormerContent:
    """A file that brings what was corrected or deleted since brings nothing new."""

    def bring(self, database: Database, data_set: bytes, new: NewImpact) -> Outcome:
        return database.write(lambda conn: impacts.add(conn, data_set, new, same_event_is_unchanged=True))

    def correct(self, database: Database, data_set: bytes, impact: Impact, new: NewImpact) -> Impact:
        return database.write(lambda conn: impacts.correct(conn, data_set, impact.id, new)).impact

    def test_what_was_corrected_is_unchanged(self, database, data_set, make_impact) -> None:
        nameless = {"external_id": None}
        first, second = (self.bring(database, data_set, make_impact(word, **nameless)).impact for word in "ab")
        once = self.correct(database, data_set, first, make_impact("c", **nameless, athlete_external_id="p-9"))
        twice = self.correct(database, data_set, once, make_impact("d", **nameless, athlete_external_id="p-9"))
        for word in "acd":
            athlete = {} if word == "a" else {"athlete_external_id": "p-9"}
            found = self.bring(database, data_set, make_impact(word, **nameless, **athlete))
            assert found == Outcome("unchanged", twice), word
        assert self.bring(database, data_set, make_impact("b", **nameless)) == Outcome("unchanged", second)

    def test_what_was_corrected_and_then_deleted_does_not_come_back(self, database, data_set, make_impact) -> None:
        first = self.bring(database, data_set, make_impact("a", external_id=None)).impact
        self.correct(database, data_set, first, make_impact("c", external_id=None))
        database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        for word in "ac":
            with pytest.raises(Problem) as caught:
                self.bring(database, data_set, make_impact(word, external_id=None))
            assert caught.value.slug == "impact-deleted"
        assert add(database, data_set, make_impact("a", external_id=None)).status == "created"
        assert self.bring(database, data_set, make_impact("a", external_id=None)).status == "unchanged"

    def test_a_deleted_event_does_not_come_back_with_less_said_of_it(self, database, data_set, make_impact) -> None:
        nameless = {"external_id": None}
        first = self.bring(database, data_set, make_impact("a", **nameless)).impact
        moved = replace(
            make_impact("a", **nameless, athlete_external_id="p-9"),
            session_id="s-9",
            content_digest=sha256(b"with its session").digest(),
        )
        self.correct(database, data_set, first, moved)
        again = replace(make_impact("a", **nameless, athlete_external_id="p-9"), content_digest=sha256(b"x").digest())
        assert self.bring(database, data_set, again).status == "unchanged"
        database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        with pytest.raises(Problem) as caught:
            self.bring(database, data_set, again)
        [together] = database.write(lambda conn: impact_batches.add_many(conn, data_set, [again]))
        assert isinstance(together, Problem)
        assert (caught.value.slug, together.slug) == ("impact-deleted", "impact-deleted")
        elsewhere = replace(again, occurred_at=datetime(2026, 1, 2, tzinfo=UTC))
        assert self.bring(database, data_set, elsewhere).status == "created"

    def test_a_deleted_event_of_a_merged_athlete_does_not_come_back(self, database, data_set, make_impact) -> None:
        first = self.bring(database, data_set, make_impact("a", external_id=None, athlete_external_id="p-1")).impact
        other = self.bring(database, data_set, make_impact("b", external_id=None, athlete_external_id="p-2")).impact
        database.write(lambda conn: athletes.merge(conn, data_set, first.athlete_id, other.athlete_id))
        database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        again = replace(
            make_impact("a", external_id=None, athlete_external_id="p-2"), content_digest=sha256(b"as p-2").digest()
        )
        with pytest.raises(Problem) as caught:
            self.bring(database, data_set, again)
        assert caught.value.slug == "impact-deleted"

    def test_a_device_that_is_mounted_anew_makes_no_new_impacts(self, database, data_set, make_impact) -> None:
        mounted = {"external_id": None, "mounted_by_device": True}
        sent = make_impact("a", **mounted)
        first = self.bring(database, data_set, sent).impact
        anew = replace(sent, input_digest=sha256(b"mounted anew").digest())
        assert self.bring(database, data_set, anew) == Outcome("unchanged", first)
        elsewhere = replace(anew, occurred_at=datetime(2026, 1, 2, tzinfo=UTC))
        assert self.bring(database, data_set, elsewhere).status == "created"
        other = replace(anew, content_digest=sha256(b"other").digest(), input_digest=sha256(b"and input").digest())
        assert self.bring(database, data_set, other).status == "created"


class TestDuplicates:
    def three(self, database: Database, data_set: bytes, make_impact) -> list[Impact]:
        return [add(database, data_set, make_impact(external_id=word)).impact for word in "abc"]

    def test_those_of_one_that_is_corrected_are_of_the_next(self, database, data_set, make_impact) -> None:
        first, second, third = self.three(database, data_set, make_impact)
        assert [one.duplicate_of for one in (first, second, third)] == [None, first.id, first.id]
        other = make_impact("other", external_id="a")
        corrected = database.write(lambda conn: impacts.correct(conn, data_set, first.id, other)).impact
        now = [get(database, data_set, one.id) for one in (second, third)]
        assert [one.duplicate_of for one in now] == [None, second.id]
        assert all(one.updated_at > before.updated_at for one, before in zip(now, (second, third), strict=True))
        assert [one.revision for one in now] == [1, 1]
        assert corrected.duplicate_of is None

    def test_those_of_one_that_is_deleted_are_of_the_next(self, database, data_set, make_impact) -> None:
        first, second, third = self.three(database, data_set, make_impact)
        database.write(lambda conn: impacts.delete(conn, data_set, first.id))
        assert [get(database, data_set, one.id).duplicate_of for one in (second, third)] == [None, second.id]
        database.write(lambda conn: impacts.delete(conn, data_set, third.id))
        assert get(database, data_set, second.id).duplicate_of is None

    def test_another_context_leaves_them(self, database, data_set, make_impact) -> None:
        first, second, _ = self.three(database, data_set, make_impact)
        elsewhere = replace(make_impact(external_id="a"), session_id="s-9", content_digest=sha256(b"s-9").digest())
        database.write(lambda conn: impacts.correct(conn, data_set, first.id, elsewhere))
        assert get(database, data_set, second.id) == second

    def test_those_of_an_erased_athlete_are_of_the_next(self, database, data_set, make_impact) -> None:
        mine = add(database, data_set, make_impact(external_id="a", athlete_external_id="p-1")).impact
        others = [
            add(database, data_set, make_impact(external_id=word, athlete_external_id="p-2")).impact for word in "bc"
        ]
        database.write(lambda conn: athletes.erase(conn, data_set, mine.athlete_id))
        assert [get(database, data_set, one.id).duplicate_of for one in others] == [None, others[0].id]


class TestPage:
    START = datetime(2026, 1, 1, tzinfo=UTC)

    @pytest.fixture
    def seven(self, database, data_set, make_impact, make_score) -> list[Impact]:
        made = []
        for number in range(7):
            new = make_impact(
                external_id=f"e{number}",
                athlete_external_id=f"p{number % 2}",
                device_serial=f"d{number % 3}",
                session_id=f"s{number % 2}",
                occurred_at=self.START + timedelta(hours=number),
                score=make_score(
                    quality_codes=("clipped",) if number == 3 else ("clipped_a_bit",),
                    probabilities={"bam": number / 10},
                ),
            )
            made.append(add(database, data_set, new).impact)
        return made

    def test_pages_run_newest_first_to_the_end(self, database, data_set, seven) -> None:
        after, seen = None, []
        with database.read() as conn:
            while True:
                page = impacts.page(conn, data_set, limit=3, after=after)
                seen += page.rows
                after = page.next
                if after is None:
                    break
        assert seen == seven[::-1]

    def test_a_page_that_is_full_and_last_says_so(self, database, data_set, seven) -> None:
        with database.read() as conn:
            assert impacts.page(conn, data_set, limit=7).next is None

    @pytest.mark.parametrize(
        ("filters", "numbers"),
        [
            ({"external_id": "e4"}, [4]),
            ({"external_id": "none"}, []),
            ({"device_serial": "d1"}, [4, 1]),
            ({"session_id": "s1"}, [5, 3, 1]),
            ({"occurred_from": START + timedelta(hours=5)}, [6, 5]),
            ({"occurred_to": START + timedelta(hours=2)}, [1, 0]),
            ({"quality_code": "clipped"}, [3]),
            ({"quality_code": "%"}, []),
            ({"min_probability": ("bam", 0.5)}, [6, 5]),
            ({"session_id": "s0", "device_serial": "d0"}, [6, 0]),
        ],
    )
    def test_filters_hold_together(self, database, data_set, seven, filters, numbers) -> None:
        rows = listed(database, data_set, ImpactFilters(**filters))
        assert [row.external_id for row in rows] == [f"e{number}" for number in numbers]

    def test_an_athletes_impacts_are_found_by_index(self, database, data_set, seven) -> None:
        rows = listed(database, data_set, ImpactFilters(athlete_id=seven[1].athlete_id))
        assert rows == [seven[5], seven[3], seven[1]]

    def test_deleted_impacts_are_listed_only_by_change(self, database, data_set, seven) -> None:
        tomb = database.write(lambda conn: impacts.delete(conn, data_set, seven[2].id))
        assert seven[2].id not in {row.id for row in listed(database, data_set)}
        changes = listed(database, data_set, updated_since=self.START)
        assert changes == [*seven[:2], *seven[3:], tomb]

    def test_a_tombstone_passes_the_filters_that_it_has_forgotten(self, database, data_set, seven) -> None:
        tomb = database.write(lambda conn: impacts.delete(conn, data_set, seven[2].id))
        by_session = listed(database, data_set, ImpactFilters(session_id="s1"), updated_since=self.START)
        of_other = ImpactFilters(athlete_id=seven[1].athlete_id)
        assert by_session[-1] == tomb
        assert tomb not in listed(database, data_set, of_other, updated_since=self.START)
        assert listed(database, data_set, ImpactFilters(session_id="s1")) == [seven[5], seven[3], seven[1]]

    def test_changes_since_an_instant_begin_with_it(self, database, data_set, seven) -> None:
        assert listed(database, data_set, updated_since=seven[4].updated_at) == seven[4:]


class TestScores:
    def add_score(self, database, data_set, impact_id, new, **options):
        return database.write(lambda conn: scores.add(conn, data_set, impact_id, new, **options))

    def test_another_models_score_stands_beside_the_first(self, database, data_set, make_impact, make_score) -> None:
        first = add(database, data_set, make_impact()).impact
        score, made = self.add_score(database, data_set, first.id, make_score(model="ours-2"))
        assert made
        assert (score.number, score.revision) == (2, 1)
        assert get(database, data_set, first.id) == first
        with database.read() as conn:
            assert scores.list_all(conn, data_set, first.id) == [first.score, score]

    def test_the_same_score_is_stored_once(self, database, data_set, make_impact, make_score) -> None:
        first = add(database, data_set, make_impact()).impact
        score, _ = self.add_score(database, data_set, first.id, make_score(model="ours-2"))
        assert self.add_score(database, data_set, first.id, make_score(model="ours-2")) == (score, False)
        assert self.add_score(database, data_set, first.id, make_score(model="ours-2", incidence=0.01))[1]

    def test_a_score_can_be_made_the_one_that_stands(self, database, data_set, make_impact, make_score) -> None:
        first = add(database, data_set, make_impact()).impact
        score, _ = self.add_score(database, data_set, first.id, make_score(model="ours-2"), make_current=True)
        present = get(database, data_set, first.id)
        assert present.score == score
        assert present.updated_at > first.updated_at

    def test_a_score_of_nothing_is_refused(self, database, data_set, make_score) -> None:
        with pytest.raises(Problem) as caught:
            self.add_score(database, data_set, ids.new(), make_score())
        assert caught.value.slug == "not-found"

    def test_a_criterion_without_columns_is_a_mistake(self, database, data_set, make_impact, make_score) -> None:
        with pytest.raises(KeyError):
            add(database, data_set, make_impact(score=make_score(values={"new_criterion": 1.0})))
        assert listed(database, data_set) == []


@pytest.mark.backend("sqlite")
def test_the_figures_for_the_planner_lead_to_the_indices(database, data_set) -> None:
    """Each lookup of the hot path and of an athlete's list is a search, never a walk through a data set."""
    with database.read() as conn:
        for query, index in (
            (impacts._SAME_EVENT._statement, "ix_impacts_data_set_id_input_digest_id"),
            (impact_known._KNOWN_BY_NAME._statement, "ix_impacts_data_set_id_updated_at_id"),
            (impact_known._KNOWN_BY_ID._statement, "ix_impacts_data_set_id_updated_at_id"),
            (impacts._SAME_DELIVERY._statement, "ix_impacts_athlete_id_occurred_at_id"),
            (impacts._FORMER._statement, "USING PRIMARY KEY (data_set_id=? AND digest=?)"),
        ):
            compiled = query.compile(dialect=conn.dialect)
            empty = tuple(compiled.params.get(name) for name in compiled.positiontup)
            plan = conn.exec_driver_sql(f"EXPLAIN QUERY PLAN {compiled}", empty).all()
            assert any(index in step[-1] for step in plan)
            assert not any(re.match("SCAN (?!CONSTANT)", step[-1]) for step in plan), plan


def test_every_criterion_of_the_science_has_its_columns() -> None:
    from headimpact.criteria import CRITERIA
    from headimpact_service.store.tables import CRITERION_COMPONENTS

    registry = CRITERIA.values() if isinstance(CRITERIA, dict) else CRITERIA
    assert [(each.key, each.components) for each in registry] == list(CRITERION_COMPONENTS.items())
