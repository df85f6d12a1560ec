"""``paddock verify``: prove a result at home.

Where the networks of all its cars are open to the racer (their own, or shared) the run is driven again from them. Where
one is not, its trace is: the file's hash is reckoned by the documented recipe, and its commands are driven again, which
proves laps, faults and penalties by the engine and the rules, and leaves open only whose network gave the commands.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import io
import itertools
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, get_type_hints

import numpy as np

from paddock.errors import UserFault
from paddock.simulator.engine import ENGINE_ID
from paddock.simulator.trace import COLUMNS, STATUSES, Row

from .asking import Call, result_of
from .driving import Where, driven, is_exact, laps_table, where_of
from .showing import one_line
from .site import Site

SAME, DIFFERENT, NOT_RUN = 0, 1, 3


def verify(asked: Call, options: argparse.Namespace) -> int:
    """Fetch, drive, compare, say. Exit status 1: something differs; 3: it could not be run."""
    site, name = result_of(asked, options.result)
    told, run = site.get(f"/evaluations/{name}/specification/"), site.get(f"/evaluations/{name}/")
    if run["result"] is None:
        raise UserFault("result_not_there", state=run["state"])
    if told["engine"] != ENGINE_ID:
        raise UserFault("engine_differs", theirs=told["engine"], ours=ENGINE_ID)
    where = where_of(site, told)
    with TemporaryDirectory(prefix="paddock-") as place:
        checks = _files(asked, site, name, told, Path(place))
        closed = sorted({car["racer"] for car in told["cars"] if not car["open"]})
        blind = bool(closed) or options.trace_only
        if blind and _retired(run):
            proof = "files"
        elif blind:
            proof, checks = "trace", checks + _from_traces(asked, where, told, run, Path(place))
        else:
            proof, checks = "network", checks + _from_networks(asked, site, where, told, run, Path(place))
    same = all(check["same"] for check in checks)
    proven = same and proof != "files"
    value = {"evaluation": name, "engine": ENGINE_ID, "proof": proof, "same": same, "proven": proven}
    words = _words(site, name, proof, closed, checks, run)
    asked.speaker.result({**value, "checks": checks, "closed": closed}, "\n".join(words))
    return DIFFERENT if not same else SAME if proven else NOT_RUN


def _retired(run: dict[str, Any]) -> bool:
    """Whether a car was taken off the track while others drove on: commands alone do not repeat that."""
    return any(result["retired"] for result in (run["result"], *run["result"]["rivals"]))


def _words(
    site: Site, name: str, proof: str, closed: list[str], checks: list[dict[str, Any]], run: dict[str, Any]
) -> list[str]:
    lines = [laps_table(run["result"]["laps"])]
    for check in checks:
        lines.append(f"{'same     ' if check['same'] else 'DIFFERENT'}  {one_line(check['what'])}")
        if not check["same"]:
            lines += [
                f"           the site: {one_line(check['site'])}",
                f"           at home:  {one_line(check['home'])}",
            ]
    page = f"{site.address}/evaluations/{name}/"
    if not all(check["same"] for check in checks):
        return [*lines, f"NOT proven: {page}"]
    if proof == "files":
        why = "a car was taken off the track while others drove on, which takes the networks to repeat"
        return [*lines, f"Not proven, but for the files: {why}. {page}"]
    if proof == "network":
        return [*lines, f"Proven: the networks were driven again, and came to the same to the bit. {page}"]
    if closed:
        why = f"The network of {one_line(', '.join(closed))} is not open to you"
        why += "." if site.token else "; log in: what is shared is open to every racer."
    else:
        why = "The networks were left out, as you wished."
    return [
        *lines,
        f"Proven without the networks: the commands of the trace were driven again, and laps, faults and times follow "
        f"from them by this engine and these rules, to the bit. {why} {page}",
    ]


def _files(asked: Call, site: Site, name: str, told: dict[str, Any], folder: Path) -> list[dict[str, Any]]:
    """Fetch the trace of every car into the folder; whether each has the hash that stands beside its result."""
    checks = []
    for place, car in enumerate(told["cars"]):
        number = car["number"]
        asked.speaker.progress(f"fetching the trace of car {number}")
        data = site.raw("GET", f"/evaluations/{name}/trace/?car={number}")
        (folder / f"{place}.csv").write_bytes(data)  # by our own number: the site's word is no part of a path
        try:
            found = trace_sha256(data)
        except (ValueError, LookupError, TypeError, OverflowError, csv.Error) as error:
            raise UserFault("trace_strange", problem=" ".join(str(error).split())[:200]) from error
        checks.append(_check(f"hash of the file of car {number}, by the recipe", car["trace_sha256"], found))
    return checks


def _from_traces(
    asked: Call, where: Where, told: dict[str, Any], run: dict[str, Any], folder: Path
) -> list[dict[str, Any]]:
    traces = [str(folder / f"{place}.csv") for place in range(len(told["cars"]))]
    with driven(where, asked.speaker, traces=traces) as (came, _):
        _note_libraries(asked, run, came)
        return _compared(told, run, came, "commands driven again")


def _from_networks(
    asked: Call, site: Site, where: Where, told: dict[str, Any], run: dict[str, Any], folder: Path
) -> list[dict[str, Any]]:
    cars, checks = [], []
    for place, car in enumerate(told["cars"]):
        asked.speaker.progress(f"fetching the network of car {car['number']}")
        package = folder / f"{place}.zip"
        package.write_bytes(site.raw("GET", f"/models/{car['model']['public_id']}/package/"))
        cars.append({"files": [str(package)], "checkpoint": ""})
    with driven(where, asked.speaker, cars=cars) as (came, _):
        for car, drove in zip(told["cars"], came["cars"], strict=True):
            checks.append(_check(f"network of car {car['number']}", car["model"]["sha256"], drove["sha256"]))
        checks += _compared(told, run, came, "network driven again")
        _note_libraries(asked, run, came)
        if not is_exact(came):
            asked.speaker.note(
                "This system's arithmetic is not the site's to the last bit (that takes x86-64 and glibc): a "
                "difference here proves nothing."
            )
        return checks


def _note_libraries(asked: Call, run: dict[str, Any], came: dict[str, Any]) -> None:
    """Say where libraries differ: equal engines should make up for it, and where they do not it is the first guess."""
    theirs, ours = run["result"]["versions"], came["versions"]
    names = [name for name in ("pybullet", "numpy", "opencv", "libc") if theirs.get(name, ours[name]) != ours[name]]
    for name in names:
        asked.speaker.note(f"{name}: {theirs[name]} on the site, {ours[name]} here")


def _compared(told: dict[str, Any], run: dict[str, Any], came: dict[str, Any], how: str) -> list[dict[str, Any]]:
    results = [run["result"], *sorted(run["result"]["rivals"], key=lambda rival: rival["number"])]
    checks = []
    for car, result, drove in zip(told["cars"], results, came["cars"], strict=True):
        whose = f"car {car['number']}, {how}"
        checks.append(_check(f"{whose}: trace", car["trace_sha256"], drove["trace_sha256"]))
        checks.append(_check(f"{whose}: laps and sectors", _laps(result["laps"]), _laps(drove["laps"])))
        checks.append(_check(f"{whose}: how it ended", result["end_reason"], drove["end_reason"]))
    if len(results) > 1:
        checks.append(_check("order of the cars", run["result"]["order"], came["order"]))
    return checks


def _laps(laps: list[dict[str, Any]]) -> list[Any]:
    names = ("number", "time_ms", "sector_ms", "off_tracks", "crashes", "resets", "status")
    return [[lap[name] for name in names] for lap in laps]


def _check(what: str, site: Any, home: Any) -> dict[str, Any]:
    return {"what": what, "same": site == home, "site": site, "home": home}


def trace_sha256(data: bytes) -> str:
    """The hash of a sim-trace's CSV by the recipe of docs/simulator.md: of each column its name, its length, its type
    and its values. Raises ValueError, LookupError, TypeError, OverflowError, csv.Error for what is no such file."""
    rows = list(csv.reader(io.StringIO(data.decode("utf-8"))))
    head, body = rows[0], rows[1:]
    values = {name: column for name, column in zip(head, itertools.zip_longest(*body), strict=False)}
    digest = hashlib.sha256()
    for name in COLUMNS:
        column = _column(get_type_hints(Row)[name], values.get(name, ()) if body else ())
        digest.update(f"{name}:{len(column)}:{column.dtype.str};".encode())
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _column(kind: type, texts: Any) -> np.ndarray:
    if kind is bool:
        return np.array([text == "True" for text in texts], dtype="|b1")
    if kind is str:
        return np.array(texts, dtype=f"<U{max(map(len, STATUSES))}")
    return np.array([kind(text) for text in texts], dtype="<i8" if kind is int else "<f8")
