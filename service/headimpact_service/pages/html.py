"""One page frame for all pages, with a content policy that lets nothing in from elsewhere."""

from __future__ import annotations

from string import Template

from starlette.responses import HTMLResponse, Response

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

_FRAME = Template("""\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
$head
</head>
<body>
$body
</body>
</html>
""")


def page(title: str, body: str, *, head: str) -> Response:
    """A page; `title`, `head` and `body` are HTML."""
    text = _FRAME.substitute(title=title, head=head, body=body)
    return HTMLResponse(text, headers={"Content-Security-Policy": POLICY})
