"""Starts the process that drives at home and collects what it needs from a race."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paddock.errors import PlatformFault, UserFault, fault_from_dict
from paddock.geometry.catalogue import CATALOGUE, CatalogueTrack
from paddock.geometry.catalogue.names import find, nearest
from paddock.rules.race import LIVE_LAPS, RUN_RULES, RaceRules

from .child import HomeJob, HomeMessage, HomeResult, JobCar
from .child import main as drive_at_home
from .files import UNREADABLE, file_faults
from .pinned import PYTHON, environment, is_ready
from .showing import Speaker, lap_time, table
from .site import Served, Site

if TYPE_CHECKING:
    from paddock.geometry.track import TrackGeometry
    from paddock.simulator.results import LapDocument


CHILD = "paddock.cli.child"
_KEPT_CHARACTERS = 500  # characters of a process's last message


@dataclass(frozen=True)
class Where:
    """The specification of a run: a track in the driven direction, or one of the catalogue, its look, the rules, and
    the engine of the site (empty without a site)."""

    track: TrackGeometry | CatalogueTrack
    look: str
    rules: RaceRules
    engine: str = ""


def where_of(site: Site, specification: Served) -> Where:
    """Read a specification of the API; the track is this package's or else the site's.

    Raises UserFault ``rules_unknown``, ``track_differs``, and whatever a request raises."""
    try:
        rules = RaceRules.from_dict(specification["rules"])
        _refuse_endless(rules)
        track, look = specification["track"], str(specification["track"]["look"])
        slug, fingerprint = str(track["slug"]), str(track["fingerprint"])
    except (KeyError, TypeError, ValueError) as error:
        raise UserFault("rules_unknown", problem=" ".join(str(error).split())[:_KEPT_CHARACTERS]) from error
    ours = next((each for each in CATALOGUE if each.fingerprint == fingerprint), None)
    geometry = ours.geometry() if ours else _of_the_site(site, slug)
    if geometry.fingerprint != fingerprint:
        raise UserFault("track_differs", track=slug)
    return Where(geometry.in_direction(rules.direction), look, rules, str(specification.get("engine", "")))


def _refuse_endless(rules: RaceRules) -> None:
    """Raise ValueError for a rule beyond its bound: a site could keep this computer busy for weeks. Laps may be more,
    because only time ends a run of a live event."""
    for name, rule in RUN_RULES.items():
        value, most = getattr(rules, name), LIVE_LAPS if name == "laps" else rule.most
        if most is not None and isinstance(value, (int, float)) and value > most:
            raise ValueError(f"{name} must be at most {most}, not {value}")


def _of_the_site(site: Site, slug: str) -> TrackGeometry:
    from paddock.geometry.track import TrackGeometry

    points: Any = site.get(f"/tracks/{slug}/")
    if points.get("centre") is None:
        raise UserFault("track_differs", track=slug)
    return TrackGeometry.from_dict(points)


def track_here(name: str) -> TrackGeometry:
    """A track of the catalogue by any of its names, or an ``.npy`` file. Raises UserFault."""
    named = find(name)
    if named is not None:
        return named.track.geometry()
    from paddock.geometry.files import FILES, MAX_BYTES, read_track

    path = Path(name)
    if path.suffix not in FILES:
        raise UserFault("track_unknown", name=name, nearest=", ".join(nearest(name)))
    with file_faults(UNREADABLE, name), path.open("rb") as file:
        return read_track(file.read(MAX_BYTES + 1), path.stem)


@contextlib.contextmanager
def driven(
    where: Where, speaker: Speaker, *, cars: list[JobCar] | None = None, traces: list[str] | None = None
) -> Iterator[tuple[HomeResult, Path]]:
    """Drive in a separate process with the site's arithmetic; gives the result and a temporary folder with the traces
    (``0.csv`` and so on). For ``cars`` and ``traces`` see :class:`.child.HomeJob`.

    Raises the faults of reading and driving, and PlatformFault("drive_failed")."""
    with tempfile.TemporaryDirectory(prefix="paddock-") as place:
        folder = Path(place)
        track = where.track.slug if isinstance(where.track, CatalogueTrack) else where.track.to_dict()
        job: HomeJob = {"track": track, "look": where.look, "rules": where.rules.to_dict()}
        job |= {"cars": cars or []} if traces is None else {"traces": traces}
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        yield _listen(folder, speaker), folder


def _listen(folder: Path, speaker: Speaker) -> HomeResult:
    arguments = [str(folder / "job.json"), str(folder)]
    with (folder / "stderr").open("w+b") as stderr:
        process: subprocess.Popen[bytes] | _CopiedProcess
        if is_ready():
            process = _CopiedProcess(arguments, stderr.fileno())
        else:
            command = [*PYTHON, "-m", CHILD, *arguments]
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, env=environment())
        assert process.stdout is not None
        message: HomeMessage = {}
        try:
            for line in process.stdout:
                message = json.loads(line)
                if "progress" in message:
                    now = message["progress"]
                    share = (now["lap"] - 1 + now["percent"] / 100) / now["laps"]
                    speaker.progress(f"lap {now['lap']} of {now['laps']}, {now['percent']:.0f} %", share)
        except ValueError:
            message = {}
        finally:
            process.stdout.close()
            if not message or "progress" in message:
                process.kill()
            process.wait()
        if "error" in message:
            try:
                raise fault_from_dict(message["error"])
            except (KeyError, TypeError) as error:
                problem = str(message["error"])[:_KEPT_CHARACTERS]
                raise PlatformFault("drive_failed", problem=problem) from error
        if "result" not in message:
            stderr.seek(0)
            words = stderr.read().decode("utf-8", "replace").strip().split("\n")[-1]
            raise PlatformFault("drive_failed", problem=words[:_KEPT_CHARACTERS] or f"exit status {process.returncode}")
    return message["result"]


class _CopiedProcess:
    """A copy of this process that drives, like the part of Popen that is used."""

    def __init__(self, arguments: list[str], stderr: int) -> None:
        reading, writing = os.pipe()
        self.returncode = 0
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # nobody waits for a process where a caller had it ignored
        self._pid = os.fork()
        if not self._pid:
            status = 1
            try:
                os.close(reading)  # so that writing fails once the other has ended
                os.dup2(writing, 1)
                os.dup2(stderr, 2)
                status = drive_at_home(*arguments)
            except Exception:  # whatever a drive raises: the command shows the last line as drive_failed
                traceback.print_exc()
            finally:  # not the end of a process, which would remove the other's temporary folder
                os._exit(status)
        os.close(writing)
        self.stdout = os.fdopen(reading, "rb")

    def kill(self) -> None:
        os.kill(self._pid, signal.SIGKILL)

    def wait(self) -> None:
        self.returncode = os.waitstatus_to_exitcode(os.waitpid(self._pid, 0)[1])


def is_exact(result: HomeResult) -> bool:
    """Whether the arithmetic here is the site's to the bit: x86-64 and glibc, started with the pins."""
    import platform

    return (
        bool(result["exact"])
        and platform.machine() in ("x86_64", "AMD64")
        and result["versions"]["libc"].startswith("glibc")
    )


def laps_table(laps: Sequence[LapDocument]) -> str:
    rows = [
        (lap["number"], lap_time(lap["time_ms"]), lap["off_tracks"], lap["crashes"], lap["resets"], lap["status"])
        for lap in laps
    ]
    return table(("lap", "time", "off track", "crashes", "resets", "status"), rows)


def figures(laps: Sequence[LapDocument]) -> dict[str, int | None]:
    """Best and average over the complete laps, and the time of all of them, in milliseconds."""
    complete = [lap["time_ms"] for lap in laps if lap["complete"]]
    return {
        "best_lap_ms": min(complete, default=None),
        "average_ms": sum(complete) // len(complete) if complete else None,
        "total_ms": sum(lap["time_ms"] for lap in laps),
        "complete_laps": len(complete),
    }
