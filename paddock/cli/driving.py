"""Driving at home: the process that does it, and what a race asks of it."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from paddock import exact
from paddock.errors import PaddockError, PlatformFault, UserFault, fault_from_dict
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.catalogue.names import find, nearest
from paddock.geometry.files import FILES, read_track
from paddock.geometry.npy import MAX_BYTES
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import LIVE_LAPS, RUN_RULES, RaceRules

from .showing import Speaker, lap_time, table
from .site import Site

CHILD = "paddock.cli.child"
_SAID = 500  # characters of what a process said before it ended
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ORT_DISABLE_TELEMETRY": "1", "PYTHONUTF8": "1"}


@dataclass(frozen=True)
class Where:
    """What a run is told: a track in the driven direction, its look, the rules, and the engine that the site drives
    with (nothing where no site is asked)."""

    track: TrackGeometry
    look: str
    rules: RaceRules
    engine: str = ""


def where_of(site: Site, told: Mapping[str, Any]) -> Where:
    """What a specification of the API says, with the track of this package or, where it has none such, the site's.

    Raises UserFault ``rules_unknown``, ``track_differs``, and whatever a request raises."""
    try:
        rules = RaceRules.from_dict(told["rules"])
        _refuse_endless(rules)
        track, look = told["track"], str(told["track"]["look"])
        slug, fingerprint = str(track["slug"]), str(track["fingerprint"])
    except (KeyError, TypeError, ValueError) as error:
        raise UserFault("rules_unknown", problem=" ".join(str(error).split())[:_SAID]) from error
    ours = next((each for each in CATALOGUE if each.fingerprint == fingerprint), None)
    geometry = ours.geometry() if ours else _of_the_site(site, slug)
    if geometry.fingerprint != fingerprint:
        raise UserFault("track_differs", track=slug)
    return Where(geometry.in_direction(rules.direction), look, rules, str(told.get("engine", "")))


def _refuse_endless(rules: RaceRules) -> None:
    """Raise ValueError for more of anything than a race may have: a site that names a billion milliseconds would keep
    this computer busy for weeks. Laps may be more: in a live event it is time alone that ends a run."""
    for name, rule in RUN_RULES.items():
        value, most = getattr(rules, name), LIVE_LAPS if name == "laps" else rule.most
        if most is not None and isinstance(value, (int, float)) and value > most:
            raise ValueError(f"{name} must be at most {most}, not {value}")


def _of_the_site(site: Site, slug: str) -> TrackGeometry:
    points = site.get(f"/tracks/{slug}/")
    if points.get("centre") is None:
        raise UserFault("track_differs", track=slug)
    return TrackGeometry.from_dict(points)


def track_here(name: str) -> TrackGeometry:
    """A track of the catalogue by any of its names, or an ``.npy`` file. Raises UserFault."""
    named = find(name)
    if named is not None:
        return named.track.geometry()
    path = Path(name)
    if path.suffix not in FILES:
        raise UserFault("track_unknown", name=name, nearest=", ".join(nearest(name)))
    try:
        with path.open("rb") as file:
            return read_track(file.read(MAX_BYTES + 1), path.stem)
    except OSError as error:
        raise UserFault("home_file_unreadable", path=name, problem=error.strerror or str(error)) from error


@contextlib.contextmanager
def driven(where: Where, speaker: Speaker, **what: Any) -> Iterator[tuple[dict[str, Any], Path]]:
    """Drive in a process of its own, with the site's arithmetic; what the child says and a folder with the traces
    (``0.csv`` and so on), which is gone afterwards. ``what``: ``cars`` or ``traces``, see :mod:`.child`.

    Raises the faults of reading and driving, and PlatformFault("drive_failed")."""
    with tempfile.TemporaryDirectory(prefix="paddock-") as place:
        folder = Path(place)
        job = {"track": where.track.to_dict(), "look": where.look, "rules": where.rules.to_dict(), **what}
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        yield _listen(folder, speaker), folder


def _listen(folder: Path, speaker: Speaker) -> dict[str, Any]:
    command = [sys.executable, "-m", CHILD, str(folder / "job.json"), str(folder)]
    environment = exact.environment({**os.environ, **_ONE_THREAD})
    with (folder / "stderr").open("w+b") as stderr:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, env=environment)
        assert process.stdout is not None
        said: dict[str, Any] = {}
        try:
            for line in process.stdout:
                said = json.loads(line)
                if "progress" in said:
                    now = said["progress"]
                    share = (now["lap"] - 1 + now["percent"] / 100) / now["laps"]
                    speaker.progress(f"lap {now['lap']} of {now['laps']}, {now['percent']:.0f} %", share)
        except ValueError:
            said = {}
        finally:
            process.stdout.close()
            if not said or "progress" in said:
                process.kill()
            process.wait()
        if "error" in said:
            raise _fault(said["error"])
        if "result" not in said:
            stderr.seek(0)
            words = stderr.read().decode("utf-8", "replace").strip().split("\n")[-1]
            raise PlatformFault("drive_failed", problem=words[:_SAID] or f"exit status {process.returncode}")
    result: dict[str, Any] = said["result"]
    return result


def _fault(said: dict[str, Any]) -> PaddockError:
    try:
        return fault_from_dict(said)
    except (KeyError, TypeError):
        return PlatformFault("drive_failed", problem=str(said)[:_SAID])


def is_exact(result: Mapping[str, Any]) -> bool:
    """Whether arithmetic here is the site's, to the bit: a processor of x86-64 and glibc, started with the pins."""
    return (
        bool(result["exact"])
        and platform.machine() in ("x86_64", "AMD64")
        and result["versions"]["libc"].startswith("glibc")
    )


def laps_table(laps: Sequence[Mapping[str, Any]]) -> str:
    """The laps of one car."""
    rows = [
        (lap["number"], lap_time(lap["time_ms"]), lap["off_tracks"], lap["crashes"], lap["resets"], lap["status"])
        for lap in laps
    ]
    return table(("lap", "time", "off track", "crashes", "resets", "status"), rows)


def figures(laps: Sequence[Mapping[str, Any]]) -> dict[str, int | None]:
    """Best and average over the complete laps, and the time of all of them, in milliseconds."""
    complete = [lap["time_ms"] for lap in laps if lap["complete"]]
    return {
        "best_lap_ms": min(complete, default=None),
        "average_ms": sum(complete) // len(complete) if complete else None,
        "total_ms": sum(lap["time_ms"] for lap in laps),
        "complete_laps": len(complete),
    }
