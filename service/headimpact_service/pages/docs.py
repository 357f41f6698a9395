"""`/docs` and the assets it needs, `/openapi.json`."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from types import MappingProxyType

from starlette.responses import RedirectResponse, Response

from headimpact_service.answers import JSON
from headimpact_service.errors import not_found
from headimpact_service.operation import PUBLIC, Answer, Call, Routes
from headimpact_service.pages.html import page

HTML = "text/html"
# Only these names are served: nothing of a request ever becomes a path.
ASSETS = MappingProxyType(
    {
        "docs.js": "text/javascript",
        "pages.css": "text/css",
        "swagger-ui-bundle.js": "text/javascript",
        "swagger-ui.css": "text/css",
        "swagger-ui.LICENSE.txt": "text/plain",
        "swagger-ui.NOTICE.txt": "text/plain",
        "swagger-ui-bundle.js.LICENSE.txt": "text/plain",
    }
)
_HEAD = '<link rel="stylesheet" href="assets/swagger-ui.css">'
_BODY = """\
<div id="swagger-ui"></div>
<noscript>This page needs JavaScript; the same description is at <a href="openapi.json">openapi.json</a>.</noscript>
<script src="assets/swagger-ui-bundle.js"></script>
<script src="assets/docs.js"></script>"""

routes = Routes("documentation")


@routes("GET", "/docs", "This API, to read and to try", PUBLIC, {200: Answer(None, "A page.", (HTML,))})
async def read_docs(call: Call) -> Response:  # noqa: ARG001 - the shape of a handler
    """Swagger UI, served from here: nothing is fetched from another host."""
    return page("Headimpact API", _BODY, head=_HEAD)


@routes("GET", "/openapi.json", "This API as OpenAPI 3.1", PUBLIC, {200: Answer(None, "The document.", (JSON,))})
async def read_openapi(call: Call) -> Response:
    """The document that clients and tests are made from."""
    return Response(call.request.app.state.openapi, media_type=JSON)


@routes("GET", "/assets/{name}", "A part of a page", PUBLIC, {200: Answer(None, "The file.", ())}, documented=False)
async def read_asset(call: Call) -> Response:
    """A script or style sheet of a page."""
    name = call.path("name")
    if name not in ASSETS:
        raise not_found("asset")
    return Response(_asset(name), media_type=ASSETS[name], headers={"Cache-Control": "max-age=3600"})


@routes("GET", "/", "To the documentation", PUBLIC, {200: Answer(None, "The documentation.", ())}, documented=False)
async def read_root(call: Call) -> Response:  # noqa: ARG001 - the shape of a handler
    """A browser that comes without a path is shown the documentation."""
    return RedirectResponse("docs")


@cache
def _asset(name: str) -> bytes:
    return files("headimpact_service.pages").joinpath("assets", name).read_bytes()
