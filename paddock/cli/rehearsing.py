"""``paddock evaluate``: drives a car at home under the rules of a race or any others."""

import argparse
import json
from pathlib import Path
from typing import Any, TypedDict

from paddock.errors import UserFault
from paddock.geometry.catalogue.names import find
from paddock.rules.race import RUN_RULES, BoxPlace, RaceRules
from paddock.rules.speed import SpeedCommand
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.engine import ENGINE_ID

from .asking import Call, race_of
from .child import HomeResult, JobCar
from .driving import Where, driven, figures, is_exact, laps_table, track_here, where_of
from .files import UNWRITABLE, file_faults, parts_of
from .showing import lap_time
from .site import Site, SiteRefusal

DIFFERENT = 1


class SiteRun(TypedDict):
    """The finished run of a car in a race of the site; ``laps``: their times in milliseconds."""

    evaluation: str
    engine: str
    trace_sha256: str
    laps: list[int]


def evaluate(asked: Call, options: argparse.Namespace) -> int:
    """Drive a car, show the result, and compare it with the site's result of the same car in the race."""
    if options.race:
        if options.rule or options.look:
            raise UserFault("home_command_line", problem="--rule and --look belong to --track: a race has its own")
        site, slug = race_of(asked, options.race)
        where = where_of(site, site.get(f"/races/{slug}/specification/"))
    else:
        named = find(options.track)
        rules = _rules([*([f"direction={named.direction}"] if named and named.direction else []), *options.rule])
        track = named.track if named else track_here(options.track).in_direction(rules.direction)
        where = Where(track, options.look or OFFICIAL.name, rules)
    own = [str(path) for path in parts_of(options.model).values()]
    cars: list[JobCar] = [{"files": own, "checkpoint": options.checkpoint}]
    cars += [{"files": [rival], "checkpoint": ""} for rival in options.rival]
    with driven(where, asked.speaker, cars=cars) as (came, folder):
        if options.trace:
            trace = (folder / "0.csv").read_bytes()
            with file_faults(UNWRITABLE, options.trace):
                Path(options.trace).write_bytes(trace)
    lines, value = _summary(came)
    status = 0
    if options.race:
        compared = _of_the_site(site, slug, came) if site.token else None
        value["site"] = {"address": site.address, "race": slug, "engine": where.engine, "run": compared}
        comparison, same = _compared(site, where, came, compared)
        lines.append(comparison)
        value["same_as_the_site"] = same
        status = DIFFERENT if same is False else 0
    asked.speaker.result(value, "\n".join(lines))
    return status


def _rules(given: list[str]) -> RaceRules:
    """Rules from ``name=value``, by the names of docs/reference.md; a value is JSON or a plain word."""
    values: dict[str, Any] = {}
    try:
        for text in given:
            name, equals, value = text.partition("=")
            if not equals or name not in RUN_RULES:
                raise ValueError(f"{text} is not NAME=VALUE with one of {', '.join(RUN_RULES)}")
            try:
                values[name] = json.loads(value)
            except ValueError:
                values[name] = value
        if "boxes" in values:
            values["boxes"] = tuple(BoxPlace(float(share), str(lane)) for share, lane in values["boxes"])
        if "speed_commands" in values:
            values["speed_commands"] = tuple(SpeedCommand(*command) for command in values["speed_commands"])
        return RaceRules(**values)
    except (ValueError, TypeError) as error:
        raise UserFault("rule_senseless", problem=" ".join(str(error).split())) from error


def _summary(came: HomeResult) -> tuple[list[str], dict[str, object]]:
    lines = ["{name}, {length_m:.2f} m, {direction}".format_map(came["track"])]
    for number, car in enumerate(came["cars"]):
        if len(came["cars"]) > 1:
            lines.append(f"\ncar {number}, place {came['order'].index(number) + 1}")
        mean = figures(car["laps"])
        best, average, total = (lap_time(mean[name]) for name in ("best_lap_ms", "average_ms", "total_ms"))
        lines += [laps_table(car["laps"]), f"best {best}, average {average}, total {total}; ended: {car['end_reason']}"]
        if car["retired"]:
            lines.append(f"retired: {car['retired']['code']}")
        lines += [f"model {car['sha256']}", f"engine {came['engine']}, trace {car['trace_sha256']}"]
    cars = [{**car, **figures(car["laps"])} for car in came["cars"]]
    about = {"engine": came["engine"], "versions": came["versions"], "order": came["order"]}
    return lines, {**cars[0], "rivals": cars[1:], **about}


def _of_the_site(site: Site, slug: str, came: HomeResult) -> SiteRun | None:
    """The run of the same car of the token's racer; None without one."""
    try:
        submissions = site.pages(f"/races/{slug}/submissions/")
    except SiteRefusal as refusal:
        if refusal.answer["code"] != "entry_missing":
            raise
        submissions = []
    for sent in submissions:
        if sent["model"]["sha256"] == came["cars"][0]["sha256"] and sent["state"] == "finished":
            result = site.get(f"/evaluations/{sent['evaluation']}/")["result"]
            return {
                "evaluation": sent["evaluation"],
                "engine": result["engine"],
                "trace_sha256": result["trace_sha256"],
                "laps": [lap["time_ms"] for lap in result["laps"]],
            }
    return None


def _compared(site: Site, where: Where, came: HomeResult, run: SiteRun | None) -> tuple[str, bool | None]:
    """The line about the site's run, and whether the hashes are equal (None without two hashes)."""
    if where.engine != ENGINE_ID:
        return (
            f"{site.address} drives with the engine {where.engine} and this package with {ENGINE_ID}: "
            "lap times there may be other ones, and hashes are not compared.",
            None,
        )
    if run is None:
        why = "this car has no result of yours in that race yet" if site.token else "without a token it shows none"
        return f"Driven by the rules and the engine of {site.address}; nothing to compare with: {why}.", None
    page = f"{site.address}/evaluations/{run['evaluation']}/"
    if run["engine"] != ENGINE_ID:
        return f"The site's run is of the engine {run['engine']}, so it is not compared: {page}", None
    if run["trace_sha256"] == came["cars"][0]["trace_sha256"]:
        return f"The same as the site's run, to the bit: {page}", True
    why = "" if is_exact(came) else " This system's arithmetic is not the site's to the last bit, which explains it."
    return f"DIFFERENT from the site's run, whose trace is {run['trace_sha256']}: {page}{why}", False
