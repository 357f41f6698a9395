"""Organisations, their keys and their settings."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

import pytest

from headimpact_service.errors import Problem
from headimpact_service.store import ids, keys, organisation_settings, organisations
from headimpact_service.store.database import Database
from headimpact_service.store.keys import KeyRow


class TestKeys:
    def test_a_new_key_is_shown_once_and_stored_as_a_digest(self, database: Database, tmp_path) -> None:
        _, plaintext = database.write(lambda conn: keys.create_key(conn, "Club", ["score"], "test", "laptop"))
        database.close()
        assert re.fullmatch(r"him_test_[A-Za-z0-9_-]{43}", plaintext)
        assert all(plaintext.encode() not in file.read_bytes() for file in tmp_path.iterdir())

    def test_a_key_is_found_by_its_plaintext_and_by_its_digest(self, database: Database) -> None:
        made, plaintext = database.write(lambda conn: keys.create_key(conn, "Club", ["score", "score", "admin"]))
        assert made.scopes == {"score", "admin"}
        assert (made.mode, made.organisation_name, made.name) == ("live", "Club", "key")
        assert plaintext.startswith(made.shown)
        with database.read() as conn:
            assert keys.find_key(conn, plaintext) == keys.find_key(conn, keys.digest(plaintext)) == made

    def test_an_unknown_key_is_none(self, database: Database, key: KeyRow) -> None:
        with database.read() as conn:
            assert keys.find_key(conn, "him_live_" + "x" * 43) is None
            assert keys.find_key(conn, "\ud800") is None
            assert keys.get_key(conn, key.organisation_id, ids.new()) is None

    def test_a_revoked_key_is_kept_and_not_found(self, database: Database) -> None:
        made, plaintext = database.write(lambda conn: keys.create_key(conn, "Club", ["score"]))
        revoked = database.write(lambda conn: keys.revoke_key(conn, made.organisation_id, made.id))
        again = database.write(lambda conn: keys.revoke_key(conn, made.organisation_id, made.id))
        assert revoked.revoked_at is not None
        assert again == revoked
        with database.read() as conn:
            assert keys.find_key(conn, plaintext) is None
            assert keys.list_keys(conn, made.organisation_id) == [revoked]

    def test_an_expired_key_is_not_found(self, database: Database) -> None:
        past = datetime.now(UTC) - timedelta(seconds=1)
        _, plaintext = database.write(lambda conn: keys.create_key(conn, "Club", ["score"], expires_at=past))
        with database.read() as conn:
            assert keys.find_key(conn, plaintext) is None

    def test_another_organisations_key_cannot_be_revoked(self, database: Database, key: KeyRow) -> None:
        other, _ = database.write(lambda conn: keys.create_key(conn, "Other", ["score"]))
        with pytest.raises(Problem) as caught:
            database.write(lambda conn: keys.revoke_key(conn, other.organisation_id, key.id))
        assert caught.value.slug == "not-found"

    def test_keys_are_listed_newest_first_over_both_modes(self, database: Database, key: KeyRow) -> None:
        second, _ = database.write(lambda conn: keys.create_key(conn, "Club", ["score"], "test"))
        with database.read() as conn:
            assert [each.id for each in keys.list_keys(conn, key.organisation_id)] == [second.id, key.id]


class TestOrganisations:
    def test_the_first_key_ends_the_emptiness(self, database: Database) -> None:
        with database.read() as conn:
            assert organisations.is_empty(conn)
        database.write(lambda conn: keys.create_key(conn, "Club", ["score"]))
        with database.read() as conn:
            assert not organisations.is_empty(conn)

    def test_an_organisation_is_reused_by_its_name_without_blanks(self, database: Database, key: KeyRow) -> None:
        same, _ = database.write(lambda conn: keys.create_key(conn, "  Club\n", ["score"]))
        assert (same.organisation_id, same.data_set_id) == (key.organisation_id, key.data_set_id)
        with database.read() as conn:
            assert organisations.find(conn, "Nobody") is None

    def test_a_test_key_sees_another_data_set(self, database: Database, key: KeyRow) -> None:
        test, _ = database.write(lambda conn: keys.create_key(conn, "Club", ["score"], "test"))
        assert test.organisation_id == key.organisation_id
        assert test.data_set_id != key.data_set_id

    @pytest.mark.parametrize("name", ["", "   ", "x" * 201, "two\nlines", "a\x00b"])
    def test_a_name_that_is_none_is_refused(self, database: Database, name: str) -> None:
        for arguments in ((name, ["score"]), ("Club", ["score"], "live", name)):
            with pytest.raises(Problem) as caught:
                database.write(lambda conn, given=arguments: keys.create_key(conn, *given))
            assert caught.value.slug == "invalid-payload"
        with database.read() as conn:
            assert organisations.is_empty(conn)


class TestSettings:
    POINTS = ({"criterion": "bam", "sensitivity": 0.9},)

    def test_a_new_organisation_has_the_models_incidence(self, database: Database, key: KeyRow) -> None:
        with database.read() as conn:
            present = organisation_settings.get(conn, key.organisation_id)
        assert (present.incidence, present.operating_points, present.revision) == (None, (), 1)

    def test_a_change_raises_the_revision_and_reaches_the_key(self, database: Database) -> None:
        key, plaintext = database.write(lambda conn: keys.create_key(conn, "Club", ["score"]))
        for _ in range(2):  # the second changes nothing
            changed = database.write(
                lambda conn: organisation_settings.put(
                    conn, key.organisation_id, incidence=0.01, operating_points=self.POINTS
                )
            )
        assert changed.revision == 2
        with database.read() as conn:
            found = keys.find_key(conn, plaintext)
            assert organisation_settings.get(conn, key.organisation_id) == changed
        assert (found.incidence, found.operating_points, found.settings_revision) == (0.01, self.POINTS, 2)

    def test_a_change_to_another_revision_is_refused(self, database: Database, key: KeyRow) -> None:
        with pytest.raises(Problem) as caught:
            database.write(
                lambda conn: organisation_settings.put(
                    conn, key.organisation_id, incidence=0.01, operating_points=(), if_match=7
                )
            )
        assert caught.value.slug == "precondition-failed"

    def test_nobodys_settings_are_not_found(self, database: Database) -> None:
        with database.read() as conn, pytest.raises(Problem) as caught:
            organisation_settings.get(conn, ids.new())
        assert caught.value.slug == "not-found"
