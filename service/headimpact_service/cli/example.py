"""An example call that works when pasted: a whole small impact, inline."""

from __future__ import annotations

import json

from headimpact_service.examples import impact


def curl(address: str, key: str) -> str:
    """One command for a POSIX shell."""
    # A line for each list of samples; no quote in it, because the shell's quotes are around it.
    body = json.dumps(impact("first-impact"), separators=(",", ":")).replace(',"', ',\n"')
    headers = f"-H 'Authorization: Bearer {key}' -H 'Content-Type: application/json'"
    return f"curl -sS '{address}/v1/impacts' {headers} -d '\n{body}'"
