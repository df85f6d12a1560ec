"""Guests who ask for the same pages again and again: ``python -m benchmarks.spectators ADDRESS PATH...``.

Each path is asked for ``--rate`` times a second, and beside it, in the same run, a Django view that does nothing from
the same web server: milliseconds from when a request was due, so that a server that falls behind cannot hide it.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import time
from urllib.parse import urlsplit

from benchmarks.load import BARE, _server

RATE, SECONDS, READERS = 500, 6.0, 50


async def _ask(host: str, port: int, path: str, rate: int, seconds: float) -> dict[str, float]:
    took: list[float] = []
    failed = 0
    start = time.perf_counter() + 0.5

    async def reader(number: int) -> None:
        nonlocal failed
        incoming, outgoing = await asyncio.open_connection(host, port)
        request = f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n".encode()
        for turn in range(int(rate * seconds / READERS)):
            due = start + (turn * READERS + number) / rate
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            outgoing.write(request)
            head = (await incoming.readuntil(b"\r\n\r\n")).lower()
            length = int(head.partition(b"content-length: ")[2].partition(b"\r\n")[0])
            await incoming.readexactly(length)
            failed += not head.startswith(b"http/1.1 200")
            took.append(time.perf_counter() - due)
        outgoing.close()

    await asyncio.gather(*(reader(number) for number in range(READERS)))
    took.sort()
    share = {f"p{percent}_ms": round(took[len(took) * percent // 100] * 1000, 1) for percent in (50, 95, 99)}
    return {"per_second": round(len(took) / (time.perf_counter() - start)), "failed": failed, **share}


def measure(address: str, paths: list[str], rate: int = RATE, seconds: float = SECONDS) -> dict[str, dict[str, float]]:
    """``per_second`` answered, ``failed``, ``p50_ms``, ``p95_ms`` and ``p99_ms`` of each path at a running site, and of
    the bare view. Raises OSError where nobody listens, LoadError where the bare view does not start."""
    with _server("benchmarks.bare") as (bare, _):
        found = {}
        for name, whole in {BARE: f"{bare}/", **{path: f"{address}{path}" for path in paths}}.items():
            where = urlsplit(whole)
            asyncio.run(_ask(where.hostname or "", where.port or 80, where.path, READERS, 1.0))
            found[name] = asyncio.run(_ask(where.hostname or "", where.port or 80, where.path, rate, seconds))
        return found


def main() -> None:
    """All paths as one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address", help="a running site: http://127.0.0.1:8000")
    parser.add_argument("paths", nargs="+", help="what guests ask for: / /races/ /races/SLUG/")
    parser.add_argument("--rate", type=int, default=RATE, help="requests a second")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    given = parser.parse_args()
    print(json.dumps(measure(given.address, given.paths, given.rate, given.seconds), indent=1))


if __name__ == "__main__":
    main()
