"""``paddock runs``: manages private runs on a site."""

import argparse

from .asking import Call, confirmed, listed, named, pairs, written
from .files import free
from .models import model_of
from .sending import NOT_WELL, run_summary, sent_model, wait_for
from .settings import split_page
from .site import Served, Site

FILES = {"logs": ("logs", "-logs.zip"), "trace": ("trace", ".csv"), "metrics": ("metrics", ".json")}


def list_runs(asked: Call, options: argparse.Namespace) -> int:
    query = {name: getattr(options, name) for name in ("state", "track", "model", "race")}
    found = asked.site().pages("/evaluations/", **query)
    columns = ("run:public_id", "state", "track:track.slug", "type:race_type", "best lap:best_lap_ms", "total:total_ms")
    return listed(asked, found, "No runs.", *columns, "asked:asked_at", "model:model.name")


def show(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.run_id, "evaluations")
    return _shown(asked, site, site.get(f"/evaluations/{name}/"))


def start(asked: Call, options: argparse.Namespace) -> int:
    where, slug = split_page(options.race, "races") if options.race else ("", "")
    site = asked.site(where)
    body = {**pairs(options.rule), **({"race": slug} if options.race else {"track": options.track})}
    if options.rival:
        body["rivals"] = [model_of(asked, rival)[1] for rival in options.rival]
    if options.submit_if_better:
        body["submit_if_better"] = True
    body["model"] = sent_model(asked, site, options)
    run = site.post("/evaluations/", body)
    if options.wait or options.of_many:
        run = wait_for(asked, site, run["public_id"], options.timeout)
    return _shown(asked, site, run)


def wait(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.run_id, "evaluations")
    return _shown(asked, site, wait_for(asked, site, name, options.timeout))


def stop(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.run_id, "evaluations")
    run = site.post(f"/evaluations/{name}/stop/")
    asked.speaker.result(run, f"{name}: {run['state']}")
    return 0


def delete(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.run_id, "evaluations")
    confirmed(options, f"Delete the run {name} with its result, videos and files?")
    site.raw("DELETE", f"/evaluations/{name}/")
    asked.speaker.result({"deleted": name}, f"{name} deleted.")
    return 0


def download(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.run_id, "evaluations")
    path, ending = FILES[options.what]
    car = f"?car={options.car}" if options.car and options.what != "logs" else ""
    to = free(options.to or f"{name}{ending}")
    return written(asked, to, site.raw("GET", f"/evaluations/{name}/{path}/{car}"))


def _shown(asked: Call, site: Site, run: Served) -> int:
    page = f"{site.address}/evaluations/{run['public_id']}/"
    lines = run_summary(run) if run["state"] not in ("queued", "running") else [f"{run['public_id']}: {run['state']}"]
    asked.speaker.result(run, "\n".join([*lines, page]))
    return NOT_WELL if run["state"] in ("failed", "stopped") else 0
