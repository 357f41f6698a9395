"""An example call that works when pasted: a whole small impact, inline."""

from __future__ import annotations

import json

from headimpact_service.examples import impact


def curl(address: str, key: str) -> str:
    """One command for a POSIX shell, on one line so that nothing is lost on its way through a terminal."""
    body = json.dumps(impact("first-impact"), separators=(",", ":"))
    headers = f"-H 'Authorization: Bearer {key}' -H 'Content-Type: application/json'"
    return f"curl -sS '{address}/v1/impacts' {headers} -d '{body}'"
