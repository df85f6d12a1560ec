"""``paddock verify``: proves a result at home."""

# If the networks of all cars are open to the racer (their own, or shared), they drive the run again. Otherwise the
# trace is the proof: its file must have the documented hash, and its commands are driven again. That proves laps,
# faults and penalties by the engine and the rules, but not which network gave the commands.

import argparse
import csv
import io
import itertools
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypedDict, get_type_hints

from paddock.errors import UserFault
from paddock.simulator.engine import ENGINE_ID
from paddock.simulator.results import LapDocument
from paddock.simulator.trace import Row, Trace, column

from .asking import Call
from .child import HomeResult, JobCar
from .driving import Where, driven, is_exact, laps_table, where_of
from .settings import split_page
from .showing import one_line
from .site import Served, Site

SAME, DIFFERENT, NOT_RUN = 0, 1, 3


class Check(TypedDict):
    """A value of the site beside the one at home."""

    what: str
    same: bool
    site: Any
    home: Any


def verify(asked: Call, options: argparse.Namespace) -> int:
    """Drive a result again and compare. Exit status 1: something differs; 3: it could not be driven."""
    where_asked, name = split_page(options.result, "evaluations")
    if not name:
        raise UserFault("result_wanted", given=options.result)
    site = asked.site(where_asked)
    spec = site.get(f"/evaluations/{name}/specification/")
    run = site.get(f"/evaluations/{name}/")
    if (result := run["result"]) is None:
        raise UserFault("result_not_there", state=run["state"])
    if spec["engine"] != ENGINE_ID:
        raise UserFault("engine_differs", theirs=spec["engine"], ours=ENGINE_ID)
    where = where_of(site, spec)
    with TemporaryDirectory(prefix="paddock-") as place:
        checks = _files(asked, site, name, spec, Path(place))
        closed = sorted({car["racer"] for car in spec["cars"] if not car["open"]})
        blind = bool(closed) or options.trace_only
        # the commands alone do not repeat a run in which others drove on without a car
        if blind and any(one["retired"] for one in (result, *result["rivals"])):
            proof = "files"
        elif blind:
            proof, checks = "trace", checks + _from_traces(asked, where, spec, result, Path(place))
        else:
            proof, checks = "network", checks + _from_networks(asked, site, where, spec, result, Path(place))
    same = all(check["same"] for check in checks)
    proven = same and proof != "files"
    value = {"evaluation": name, "engine": ENGINE_ID, "proof": proof, "same": same, "proven": proven}
    words = _words(site, name, proof, closed, checks, result)
    asked.speaker.result({**value, "checks": checks, "closed": closed}, "\n".join(words))
    return DIFFERENT if not same else SAME if proven else NOT_RUN


def _words(site: Site, name: str, proof: str, closed: list[str], checks: list[Check], result: Served) -> list[str]:
    lines = [laps_table(result["laps"])]
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


def _files(asked: Call, site: Site, name: str, spec: Served, folder: Path) -> list[Check]:
    """Fetch the trace of every car into the folder, and compare its hash with the result's."""
    checks = []
    for place, car in enumerate(spec["cars"]):
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


def _from_traces(asked: Call, where: Where, spec: Served, result: Served, folder: Path) -> list[Check]:
    traces = [str(folder / f"{place}.csv") for place in range(len(spec["cars"]))]
    with driven(where, asked.speaker, traces=traces) as (came, _):
        _note_libraries(asked, result, came)
        return _compared(spec, result, came, "commands driven again")


def _from_networks(asked: Call, site: Site, where: Where, spec: Served, result: Served, folder: Path) -> list[Check]:
    cars: list[JobCar] = []
    checks = []
    for place, car in enumerate(spec["cars"]):
        asked.speaker.progress(f"fetching the network of car {car['number']}")
        package = folder / f"{place}.zip"
        package.write_bytes(site.raw("GET", f"/models/{car['model']['public_id']}/package/"))
        cars.append({"files": [str(package)], "checkpoint": ""})
    with driven(where, asked.speaker, cars=cars) as (came, _):
        for car, drove in zip(spec["cars"], came["cars"], strict=True):
            checks.append(_check(f"network of car {car['number']}", car["model"]["sha256"], drove["sha256"]))
        checks += _compared(spec, result, came, "network driven again")
        _note_libraries(asked, result, came)
        if not is_exact(came):
            asked.speaker.note(
                "This system's arithmetic is not the site's to the last bit (that takes x86-64 and glibc): a "
                "difference here proves nothing."
            )
        return checks


def _note_libraries(asked: Call, result: Served, came: HomeResult) -> None:
    """Show libraries that differ from the site's, the first suspects where equal engines differ."""
    theirs, ours = result["versions"], came["versions"]
    names = [name for name in ("pybullet", "numpy", "opencv", "libc") if theirs.get(name, ours[name]) != ours[name]]
    for name in names:
        asked.speaker.note(f"{name}: {theirs[name]} on the site, {ours[name]} here")


def _compared(spec: Served, result: Served, came: HomeResult, how: str) -> list[Check]:
    results: list[Served] = [result, *sorted(result["rivals"], key=lambda rival: rival["number"])]
    checks = []
    for car, theirs, drove in zip(spec["cars"], results, came["cars"], strict=True):
        whose = f"car {car['number']}, {how}"
        checks.append(_check(f"{whose}: trace", car["trace_sha256"], drove["trace_sha256"]))
        checks.append(_check(f"{whose}: laps and sectors", _laps(theirs["laps"]), _laps(drove["laps"])))
        checks.append(_check(f"{whose}: how it ended", theirs["end_reason"], drove["end_reason"]))
    if len(results) > 1:
        checks.append(_check("order of the cars", result["order"], came["order"]))
    return checks


def _laps(laps: list[LapDocument]) -> list[list[object]]:
    names = itemgetter("number", "time_ms", "sector_ms", "off_tracks", "crashes", "resets", "status")
    return [list(names(lap)) for lap in laps]


def _check(what: str, site: Any, home: Any) -> Check:
    return {"what": what, "same": site == home, "site": site, "home": home}


def trace_sha256(data: bytes) -> str:
    """The hash of a sim-trace's CSV, see docs/simulator.md. Raises ValueError, LookupError, TypeError, OverflowError,
    csv.Error for another file."""
    head, *body = csv.reader(io.StringIO(data.decode("utf-8")))
    values = dict(zip(head, itertools.zip_longest(*body), strict=False))
    columns = {}
    for name, kind in get_type_hints(Row).items():
        texts = values.get(name, ())
        columns[name] = column(name, [text == "True" if kind is bool else kind(text) for text in texts])
    return Trace(columns).sha256
