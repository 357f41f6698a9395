"""Keys, and whom the present one speaks for."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field
from starlette.responses import Response

from headimpact_service import deps
from headimpact_service.answers import answer, no_content
from headimpact_service.errors import Problem, not_found
from headimpact_service.ingest.impact_json import Name, Strict
from headimpact_service.operation import ANY_KEY, Answer, Call, Routes
from headimpact_service.parameters import ListQuery
from headimpact_service.routes.lists import MEDIA_TYPES, answer_list
from headimpact_service.routes.short_lists import short_listing
from headimpact_service.store import ids, keys

routes = Routes("keys")

LIVE = "live"

Scope = Literal[deps.SCOPES]  # type: ignore[valid-type] # the one list of them
Mode = Literal["live", "test"]


class KeyView(BaseModel):
    """A key without its secret."""

    id: str
    name: str
    shown: str = Field(description="The first characters of the key.")
    mode: Mode
    scopes: list[str]
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None


class NewKeyView(KeyView):
    """A new key, with the secret that is shown this once."""

    key: str


class KeyListView(BaseModel):
    """A page of the organisation's keys, newest first."""

    data: list[KeyView]
    next_cursor: str | None


class CallerView(BaseModel):
    """Whom a key speaks for."""

    organisation: str
    mode: Mode
    key: KeyView


class NewKeyBody(Strict):
    """A key to be made."""

    name: Name = Field("key", description="What it is for.")
    scopes: Annotated[list[Scope], Field(min_length=1, max_length=len(deps.SCOPES))]
    mode: Mode | None = Field(
        None, description="A test key sees a separate sandbox data set. The caller's own mode unless given."
    )


@routes("GET", "/v1/me", "Whom this key speaks for", ANY_KEY, {200: Answer(CallerView, "The key's owner.")})
async def read_me(call: Call) -> Response:
    """The organisation, the mode and the scopes of the key that was sent."""
    return answer({"organisation": call.key.organisation_name, "mode": call.key.mode, "key": document(call.key)})


@routes(
    "GET",
    "/v1/keys",
    "The organisation's keys",
    "admin",
    {200: Answer(KeyListView, "A page of keys, newest first.", MEDIA_TYPES)},
    query=ListQuery,
    problems=("bad-cursor",),
)
async def list_keys(call: Call) -> Response:
    """Revoked keys stay listed; secrets are never shown again. A test key sees test keys only."""

    def read(conn: Any) -> list[keys.KeyRow]:  # noqa: ANN401 - a connection of the store
        return [key for key in keys.list_keys(conn, call.key.organisation_id) if _within_reach(call, key)]

    listing = short_listing("keys", read, document, "id", tuple(KeyView.model_fields))
    return await answer_list(call, listing, call.query)


@routes(
    "POST",
    "/v1/keys",
    "Make a key",
    "admin",
    {201: Answer(NewKeyView, "The key, shown this once.")},
    body=NewKeyBody,
    example={"name": "sideline gate", "scopes": ["score", "impacts:write"]},
)
async def create_key(call: Call) -> Response:
    """The key belongs to the caller's organisation. A test key makes test keys only."""
    body: NewKeyBody = call.body
    mode = body.mode or call.key.mode
    if mode == LIVE and call.key.mode != LIVE:
        raise Problem("insufficient-scope", "A test key cannot make a live key.")
    key, plaintext = await deps.write(
        call.request, lambda conn: keys.create_key(conn, call.key.organisation_name, body.scopes, mode, body.name)
    )
    return answer(document(key) | {"key": plaintext}, 201)


@routes(
    "DELETE",
    "/v1/keys/{key_id}",
    "Revoke a key",
    "admin",
    {204: Answer(None, "It is revoked.", ())},
    problems=("not-found",),
)
async def revoke_key(call: Call) -> Response:
    """From now on requests with it are refused, in other processes of this service within five seconds.

    To a test key, live keys do not exist.
    """
    key_id = deps.identifier("key", call.path("key_id"), "key")

    def revoke(conn: Any) -> None:  # noqa: ANN401 - a connection of the store
        key = keys.get_key(conn, call.key.organisation_id, key_id)
        if key is None or not _within_reach(call, key):
            raise not_found("key")
        keys.revoke_key(conn, call.key.organisation_id, key_id)

    await deps.write(call.request, revoke)
    call.request.app.state.gate.forget()
    return no_content()


def _within_reach(call: Call, key: keys.KeyRow) -> bool:
    """A live key administers all keys of its organisation, a test key the test keys."""
    return call.key.mode in {LIVE, key.mode}


def document(key: keys.KeyRow) -> dict[str, Any]:
    """A key as it is answered."""
    return {
        "id": ids.encode("key", key.id),
        "name": key.name,
        "shown": key.shown,
        "mode": key.mode,
        "scopes": sorted(key.scopes),
        "created_at": key.created_at,
        "expires_at": key.expires_at,
        "revoked_at": key.revoked_at,
    }
