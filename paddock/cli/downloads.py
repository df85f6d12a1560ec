"""The commands ``download``, ``export``, ``logs`` and ``video``."""

import argparse
import json
from pathlib import Path

from paddock.errors import UserFault
from paddock.packages.kinds import CAR, OPENVINO

from .asking import ID, Call, named, wait_until, written
from .files import UNREADABLE, file_faults, free, parts_of
from .sending import NOT_WELL, wait_for
from .settings import split_page
from .site import Served
from .train import KINDS, followed

EXPORTED = {CAR: "model.tar.gz", OPENVINO: "openvino.tar.gz"}


def download(asked: Call, options: argparse.Namespace) -> int:
    given = options.what
    if "/evaluations/" in given:
        where, name = split_page(given, "evaluations")
        path, file = f"/evaluations/{name}/logs/", f"{name}-logs.zip"
    else:
        where, name = split_page(given, "models")
        path, file = f"/models/{name}/package/", f"{name}.zip"
    if not ID.fullmatch(name):
        raise UserFault("home_command_line", problem=f"{given} names no model and no result")
    to = free(options.to or file)
    return written(asked, to, asked.site(where).raw("GET", path))


def export(asked: Call, options: argparse.Namespace) -> int:
    """Write a model for physical cars or for OpenVINO: files by the engine here, a model of a site by the site."""
    file = EXPORTED[options.form]
    to = free(str(Path(options.to, f"{options.name}-{file}")) if options.of_many else options.to or file)
    first = options.model[0]
    where, name = split_page(first, "models")
    if len(options.model) == 1 and not Path(first).exists() and (where or ID.fullmatch(name)):
        return written(asked, to, asked.site(where).raw("GET", f"/models/{name}/export/{options.form}/"))
    from paddock.packages.export import export_model
    from paddock.packages.metadata import parse_metadata
    from paddock.packages.own import read_car

    with file_faults(UNREADABLE):
        car = read_car(list(parts_of(options.model).values()), options.checkpoint)
    metadata = parse_metadata(json.dumps(car.metadata).encode())
    return written(asked, to, export_model(car.onnx, metadata, options.form))


def logs(asked: Call, options: argparse.Namespace) -> int:
    """Fetch all files of a run or a training. Exit status 1: with ``--follow``, the run or the training failed."""
    site, name = named(asked, options.what, "evaluations", *KINDS)
    trains = any(f"/{kind}/" in options.what for kind in KINDS)
    if not trains and "/" not in options.what:
        try:
            site.get(f"/evaluations/{name}/")
        except UserFault as fault:
            if fault.code != "not_on_site":
                raise
            trains = True
    to = free(options.to or f"{name}-logs.zip")
    status = 0
    if options.follow:
        ended = (followed if trains else wait_for)(asked, site, name, options.timeout)
        status = NOT_WELL if ended["state"] == "failed" else 0
    return written(asked, to, site.raw("GET", f"/{'trainings' if trains else 'evaluations'}/{name}/logs/")) or status


def video(asked: Call, options: argparse.Namespace) -> int:
    """Make a video of a run and fetch it. Exit status 1: it could not be made."""
    site, name = named(asked, options.run_id, "evaluations")
    to = free(options.to or f"{name}-{options.part}.mp4")
    body = {"part": options.part, "car": options.car}
    if options.language:
        body["language"] = options.language
    path = f"/videos/{site.post(f'/evaluations/{name}/videos/', body)['public_id']}/"
    page = f"{site.address}/evaluations/{name}/"

    over = ("ready", "stale", "failed")
    made = wait_until(asked, lambda: site.get(path), over, _video_progress, options.timeout, page)
    if made["state"] != "ready":
        reason = made["reason"] or {"code": made["state"], "sentence": ""}
        asked.speaker.result(made, f"{made['state']}: {reason['code']}: {reason['sentence']}")
        return NOT_WELL
    return written(asked, to, site.raw("GET", f"{path}file/"))


def _video_progress(made: Served) -> tuple[str, float | None]:
    if made["state"] == "waiting":
        return f"place {made['position']} in the queue", None
    return f"rendering, {made['progress']} %", made["progress"] / 100
