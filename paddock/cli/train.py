"""``paddock train``: manages trainings on a site."""

# Training at home is part of the starter project: ``paddock new``.

import argparse
import json
from pathlib import Path

from paddock.errors import UserFault

from .asking import Call, listed, named, pairs, wait_until
from .files import UNREADABLE, file_faults
from .sending import NOT_WELL, OVER
from .showing import lap_time
from .site import Served, Site

KINDS = ("train", "trainings")


def list_trainings(asked: Call, options: argparse.Namespace) -> int:
    found = asked.site().pages("/trainings/")
    columns = ("training:public_id", "state", "track", "algorithm", "steps", "name")
    return listed(asked, found, "No trainings.", *columns)


def start(asked: Call, options: argparse.Namespace) -> int:
    body: dict[str, object] = {}
    if options.settings:
        try:
            body = json.loads(_read(options.settings))
        except ValueError as error:
            raise UserFault(UNREADABLE, path=options.settings, problem="it is not JSON") from error
        if not isinstance(body, dict):
            raise UserFault(UNREADABLE, path=options.settings, problem="it is not a JSON object")
    for name, value in pairs(options.set).items():
        before = body.get(name)
        body[name] = {**before, **value} if isinstance(value, dict) and isinstance(before, dict) else value
    body |= {name: given for name in ("name", "track") if (given := getattr(options, name))}
    body.setdefault("name", Path(options.reward).stem.replace("_", "-"))
    if "track" not in body:
        raise UserFault("home_command_line", problem="name the track with --track")
    body["reward_code"] = _read(options.reward)
    site = asked.site()
    job = site.post("/trainings/", body)
    return watched(asked, site, job["public_id"], options.timeout) if options.wait else _shown(asked, site, job)


def _read(path: str) -> str:
    try:
        with file_faults(UNREADABLE, path):
            return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UserFault(UNREADABLE, path=path, problem="it is not UTF-8 text") from error


def show(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.training_id, *KINDS)
    return _shown(asked, site, site.get(f"/trainings/{name}/"))


def watch(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.training_id, *KINDS)
    return watched(asked, site, name, options.timeout)


def stop(asked: Call, options: argparse.Namespace) -> int:
    site, name = named(asked, options.training_id, *KINDS)
    job = site.post(f"/trainings/{name}/stop/")
    asked.speaker.result(job, f"{name}: {job['state']}" + (", stopping" if job["state"] == "running" else ""))
    return 0


def watched(asked: Call, site: Site, name: str, patience_s: float) -> int:
    """Follow a training to its end and show it; the exit status."""
    return _shown(asked, site, followed(asked, site, name, patience_s))


def followed(asked: Call, site: Site, name: str, patience_s: float) -> Served:
    """The training when it has ended. New iterations and new output of the reward function are shown meanwhile."""
    shown, printed = 0, ""

    def read() -> Served:
        nonlocal shown, printed
        job = site.get(f"/trainings/{name}/")
        if not asked.speaker.as_json:
            for line in new_text(printed, job["printed"]).splitlines():
                asked.speaker.note(f"  {line}")
            for one in job["iterations"][shown:]:
                asked.speaker.note(_iteration(one))
        shown, printed = len(job["iterations"]), job["printed"]
        return job

    return wait_until(asked, read, OVER, _how_far, patience_s, f"{site.address}/train/{name}/")


def new_text(before: str, now: str) -> str:
    """The addition to a text of which only the end is kept."""
    for start in range(len(before) + 1):
        if now.startswith(before[start:]):
            return now[len(before) - start :]
    return now


def _iteration(one: Served) -> str:
    reward = "-" if one["mean_reward"] is None else f"{one['mean_reward']:.2f}"
    lap = "" if one["eval_lap_ms"] is None else f", lap {lap_time(one['eval_lap_ms'])}"
    return (
        f"iteration {one['number']}: {one['steps']} steps, reward {reward}, "
        f"evaluation {one['eval_progress']:.0f} %{lap}{' (best)' if one['is_best'] else ''}"
    )


def _how_far(job: Served) -> tuple[str, float | None]:
    if job["state"] == "queued":
        position = job["queue_position"]
        return "waiting for a trainer" if position is None else f"place {position} in the queue", None
    return f"training: {job['steps']} steps, {job['training_s']:.0f} s", None


def _shown(asked: Call, site: Site, job: Served) -> int:
    lines = [f"{job['name']}: {job['state']}, {job['steps']} steps in {job['training_s']:.1f} s"]
    lines += [text for text in (job["ending"], job["reason"]) if text]
    models = {"best": job["best_model"], "last": job["last_model"]}
    lines += [f"{which} model: {name}" for which, name in models.items() if name]
    asked.speaker.result(job, "\n".join([*lines, f"{site.address}/train/{job['public_id']}/"]))
    return NOT_WELL if job["state"] == "failed" else 0
