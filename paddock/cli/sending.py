"""Commands that send and fetch: ``upload``, ``submit``, ``download``, ``export``."""

from __future__ import annotations

import argparse
import json
import re
import time
from pathlib import Path
from typing import Any

from paddock.errors import PlatformFault, UserFault
from paddock.packages.kinds import CAR, OPENVINO

from .asking import Call, parts_of, race_of
from .driving import figures, laps_table
from .settings import split_page
from .showing import lap_time
from .site import Site, SiteRefusal

NOT_WELL = 1
ASK_EVERY_S = 1.0  # what the API asks for at most
EXPORTED = {CAR: "model.tar.gz", OPENVINO: "openvino.tar.gz"}
_ID = re.compile(r"[a-z0-9]{12}")


def upload(asked: Call, options: argparse.Namespace) -> int:
    """Send a model to the garage."""
    site = asked.site()
    model = _uploaded(asked, site, options)
    taken = model["upload"]
    lines = [
        f"{model['name']} is in your garage: {site.address}/models/{model['public_id']}/",
        f"model {model['sha256']}",
    ]
    if taken["network"]:
        lines.append(f"taken: {taken['network']}")
    if taken["ignored"]:
        lines.append(f"not needed: {', '.join(taken['ignored'])}")
    asked.speaker.result(model, "\n".join(lines))
    return 0


def _uploaded(asked: Call, site: Site, options: argparse.Namespace) -> dict[str, Any]:
    asked.speaker.progress(f"sending {options.model[0]}")
    fields = {name: getattr(options, name) for name in ("name", "checkpoint") if getattr(options, name)}
    model: dict[str, Any] = site.send_files("/models/", parts_of([Path(name) for name in options.model]), fields)
    return model


def submit(asked: Call, options: argparse.Namespace) -> int:
    """Send a car to a race, and with ``--wait`` wait for its result."""
    site, slug = race_of(asked, options.race)
    public_id = options.model[0]
    if len(options.model) > 1 or not _ID.fullmatch(public_id) or Path(public_id).exists():
        public_id = _uploaded(asked, site, options)["public_id"]
    again = False
    try:
        evaluation = site.post(f"/races/{slug}/submissions/", {"model": public_id})["evaluation"]
    except SiteRefusal as refusal:
        evaluation = refusal.said.get("params", {}).get("evaluation")
        if refusal.said["code"] != "car_already_submitted" or not evaluation:
            raise
        again = True
        asked.speaker.note(
            "This very car was sent to this race before. The same car gives the same result: that one stands."
        )
    page = f"{site.address}/evaluations/{evaluation}/"
    if not options.wait:
        asked.speaker.result({"model": public_id, "evaluation": evaluation, "sent_before": again, "page": page}, page)
        return 0
    run = wait_for(asked, site, evaluation, options.timeout)
    entry = site.get(f"/races/{slug}/entry/")
    value = {
        "model": public_id,
        "evaluation": evaluation,
        "sent_before": again,
        "page": page,
        "run": run,
        "entry": entry,
    }
    asked.speaker.result(value, "\n".join([*_told(run), _standing(entry), page]))
    return 0 if run["state"] == "finished" else NOT_WELL


def wait_for(asked: Call, site: Site, evaluation: str, patience_s: float) -> dict[str, Any]:
    """The evaluation when it has ended. Raises PlatformFault("wait_over"), and what a request raises."""
    until = time.monotonic() + patience_s
    while True:
        run: dict[str, Any] = site.get(f"/evaluations/{evaluation}/")
        if run["state"] in ("finished", "failed", "stopped"):
            return run
        asked.speaker.progress(*_how_far(run))
        if time.monotonic() >= until:
            url = f"{site.address}/evaluations/{evaluation}/"
            raise PlatformFault("wait_over", seconds=round(patience_s), url=url)
        time.sleep(ASK_EVERY_S)


def _how_far(run: dict[str, Any]) -> tuple[str, float | None]:
    queue, now = run["queue"], run["progress"]
    if now:
        share = (now["lap"] - 1 + now["percent"] / 100) / now["laps"]
        return f"lap {now['lap']} of {now['laps']}, {now['percent']:.0f} %, {lap_time(now['total_ms'])}", share
    if queue:
        wait = queue["expected_wait_s"]
        about = "" if wait is None else f", about {wait:.0f} s"
        return f"place {queue['position']} of {queue['waiting']} in the queue{about}", None
    return "on its way to the track", None


def _told(run: dict[str, Any]) -> list[str]:
    result = run["result"]
    if result is None:
        reason = run["reason"] or {"code": run["state"], "sentence": ""}
        return [f"{run['state']}: {reason['code']}: {reason['sentence']}"]
    mean = figures(result["laps"])["average_ms"]
    return [
        laps_table(result["laps"]),
        f"best {lap_time(result['best_lap_ms'])}, average {lap_time(mean)}, total {lap_time(result['total_ms'])}",
        f"engine {result['engine']}, trace {result['trace_sha256']}",
    ]


def _standing(entry: dict[str, Any]) -> str:
    if not entry["classified"]:
        return f"not classified; {_left(entry)}"
    return f"rank {entry['rank']} with {lap_time(entry['score_ms'])}; {_left(entry)}"


def _left(entry: dict[str, Any]) -> str:
    left = entry["submissions_left"]
    return "submissions unlimited" if left is None else f"{left} submissions left"


def download(asked: Call, options: argparse.Namespace) -> int:
    """Fetch a model as a package, or all files of a run."""
    given = options.what
    if "/evaluations/" in given:
        where, name = split_page(given, "evaluations")
        path, file = f"/evaluations/{name}/logs/", f"{name}-logs.zip"
    else:
        where, name = split_page(given, "models")
        path, file = f"/models/{name}/package/", f"{name}.zip"
    if not _ID.fullmatch(name):
        raise UserFault("home_command_line", problem=f"{given} names no model and no result")
    to = _free(options.to or file)
    return _written(asked, to, asked.site(where).raw("GET", path))


def export(asked: Call, options: argparse.Namespace) -> int:
    """Write a model for physical cars or for OpenVINO: a file by the engine here, a model of the site's by the site."""
    to = _free(options.to or EXPORTED[options.form])
    first = options.model[0]
    where, name = split_page(first, "models")
    if len(options.model) == 1 and not Path(first).exists() and (where or _ID.fullmatch(name)):
        return _written(asked, to, asked.site(where).raw("GET", f"/models/{name}/export/{options.form}/"))
    from paddock.packages.export import export_model
    from paddock.packages.metadata import parse_metadata
    from paddock.packages.own import read_car

    try:
        car = read_car(
            [Path(path) for path in parts_of([Path(each) for each in options.model]).values()], options.checkpoint
        )
    except OSError as error:
        path, problem = str(error.filename), error.strerror or str(error)
        raise UserFault("home_file_unreadable", path=path, problem=problem) from error
    metadata = parse_metadata(json.dumps(car.metadata).encode())
    return _written(asked, to, export_model(car.onnx, metadata, options.form))


def _free(name: str) -> Path:
    """A place for a file. Raises UserFault("home_exists")."""
    if Path(name).exists():
        raise UserFault("home_exists", path=name)
    return Path(name)


def _written(asked: Call, to: Path, data: bytes) -> int:
    try:
        to.write_bytes(data)
    except OSError as error:
        raise UserFault("home_file_unwritable", path=str(to), problem=error.strerror or str(error)) from error
    asked.speaker.result({"file": str(to), "bytes": len(data)}, f"{to}  {len(data) / 1e6:.2f} MB")
    return 0
