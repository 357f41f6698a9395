"""A process that stores impacts and says on stdout which the store has acknowledged, until it is killed.

Arguments: the database's URL, the data set's id in hex, a name for its impacts, how many threads.
"""

from __future__ import annotations

import sys
import threading

from headimpact_service.store import impacts
from headimpact_service.store.database import Database
from headimpact_service.store.impacts import NewImpact
from headimpact_service.store.scores import NewScore


def main() -> None:
    url, data_set, name, threads = sys.argv[1:]
    database = Database(url)
    score = NewScore(
        state="scored", model="m", incidence=0.0055, service_version="0", input_digest=b"i" * 32, values={"bric": 0.5}
    )

    def send(thread: int) -> None:
        for number in range(1_000_000):
            external_id = f"{name}-{thread}-{number}"
            new = NewImpact(
                content_digest=b"c" * 32,
                input_digest=b"i" * 32,
                document={},
                trace=external_id.encode() * 100,
                score=score,
                external_id=external_id,
                athlete_external_id=f"p{number}",
            )
            outcome = database.write(lambda conn, new=new: impacts.add(conn, bytes.fromhex(data_set), new))
            sys.stdout.write(f"{external_id} {outcome.impact.id.hex()}\n")
            sys.stdout.flush()

    for thread in range(int(threads)):
        threading.Thread(target=send, args=(thread,)).start()


if __name__ == "__main__":
    main()
