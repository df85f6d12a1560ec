"""The commands ``upload`` and ``submit``, and ``submissions``: your cars in the races of a site."""

import argparse
from pathlib import Path

from .asking import ID, Call, confirmed, race_of, wait_until
from .driving import figures, laps_table
from .files import parts_of
from .showing import lap_time, table
from .site import Served, Site, SiteRefusal

NOT_WELL = 1
OVER = ("finished", "failed", "stopped")


def upload(asked: Call, options: argparse.Namespace) -> int:
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


def sent_model(asked: Call, site: Site, options: argparse.Namespace) -> str:
    """The id of a command's model: as given, or of the files that are uploaded now."""
    given: str = options.model[0]
    if len(options.model) == 1 and ID.fullmatch(given) and not Path(given).exists():
        return given
    return _uploaded(asked, site, options)["public_id"]


def _uploaded(asked: Call, site: Site, options: argparse.Namespace) -> Served:
    asked.speaker.progress(f"sending {options.model[0]}")
    fields = {name: getattr(options, name) for name in ("name", "checkpoint") if getattr(options, name)}
    model: Served = site.send_files("/models/", parts_of(options.model), fields)
    return model


def submit(asked: Call, options: argparse.Namespace) -> int:
    """Send a car to a race, and with ``--wait`` wait for its result."""
    site, slug = race_of(asked, options.race)
    public_id = sent_model(asked, site, options)
    again = False
    try:
        evaluation = site.post(f"/races/{slug}/submissions/", {"model": public_id})["evaluation"]
    except SiteRefusal as refusal:
        evaluation = refusal.answer.get("params", {}).get("evaluation")
        if refusal.answer["code"] != "car_already_submitted" or not evaluation:
            raise
        again = True
        asked.speaker.note(
            "This very car was sent to this race before. The same car gives the same result: that one stands."
        )
    page = f"{site.address}/evaluations/{evaluation}/"
    value = {"model": public_id, "evaluation": evaluation, "sent_before": again, "page": page}
    if not options.wait and not options.of_many:  # a race takes one car of a racer at a time
        asked.speaker.result(value, page)
        return 0
    run = wait_for(asked, site, evaluation, options.timeout)
    entry = site.get(f"/races/{slug}/entry/")
    text = "\n".join([*run_summary(run), _standing(entry), page])
    asked.speaker.result({**value, "run": run, "entry": entry}, text)
    return 0 if run["state"] == "finished" else NOT_WELL


def wait_for(asked: Call, site: Site, evaluation: str, patience_s: float) -> Served:
    """The evaluation when it has ended. Raises PlatformFault("wait_over"), and what a request raises."""
    url = f"{site.address}/evaluations/{evaluation}/"
    return wait_until(asked, lambda: site.get(f"/evaluations/{evaluation}/"), OVER, _how_far, patience_s, url)


def _how_far(run: Served) -> tuple[str, float | None]:
    queue, now = run["queue"], run["progress"]
    if now:
        share = (now["lap"] - 1 + now["percent"] / 100) / now["laps"]
        return f"lap {now['lap']} of {now['laps']}, {now['percent']:.0f} %, {lap_time(now['total_ms'])}", share
    if queue:
        wait = queue["expected_wait_s"]
        about = "" if wait is None else f", about {wait:.0f} s"
        return f"place {queue['position']} of {queue['waiting']} in the queue{about}", None
    return "on its way to the track", None


def run_summary(run: Served) -> list[str]:
    """The lines about a run that has ended: its laps, or the reason why there are none."""
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


def _standing(entry: Served) -> str:
    left = entry["submissions_left"]
    left_text = "submissions unlimited" if left is None else f"{left} submissions left"
    if not entry["classified"]:
        return f"not classified; {left_text}"
    return f"rank {entry['rank']} with {lap_time(entry['score_ms'])}; {left_text}"


def list_submissions(asked: Call, options: argparse.Namespace) -> int:
    """Your submissions to one race, or to all your races."""
    if options.race:
        site, slug = race_of(asked, options.race)
        slugs = [slug]
    else:
        site = asked.site()
        slugs = [race["slug"] for race in site.pages("/races/", mine="true")]
    found = []
    for slug in slugs:
        try:
            found += [{"race": slug, **one} for one in site.pages(f"/races/{slug}/submissions/")]
        except SiteRefusal as refusal:
            if options.race or refusal.answer["code"] != "entry_missing":  # a race that you only organise
                raise
    rows = [
        (
            *(one["race"], one["number"], one["submitted_at"][:16] + "Z", one["state"], lap_time(one["score_ms"])),
            *("best" if one["is_best"] else "", one["evaluation"], one["model"]["name"]),
        )
        for one in found
    ]
    head = ("race", "no", "sent", "state", "score", "", "run", "model")
    asked.speaker.result(found, table(head, rows, "No submissions."))
    return 0


def withdraw(asked: Call, options: argparse.Namespace) -> int:
    site, slug = race_of(asked, options.race)
    confirmed(options, f"Withdraw from {slug}?")
    site.raw("DELETE", f"/races/{slug}/entry/")
    asked.speaker.result({"race": slug, "withdrawn": True}, f"You are no longer in {slug}.")
    return 0
