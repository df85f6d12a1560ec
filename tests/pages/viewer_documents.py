"""Documents for the viewer from races that are really driven here, and a page that draws them in three dimensions."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules
from paddock.simulator.layout import lay_out
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.results import RaceResult
from races.replays.document import scene_document as the_sites_document
from tests.shared import CHECKOUT

SITE = "http://viewer.test"
PAGE = """<!doctype html><html data-theme="light"><body style="margin:0"><canvas tabindex="0" id="scene"
style="width:64px;height:36px"></canvas></body></html>"""
OPEN = """async ({scene, documents, options}) => {
  const { Replay } = await import("/static/viewer/store.js");
  const { createScene } = await import("/static/viewer/scene.js");
  window.replay = new Replay(scene, documents.map((document) => ({ document })));
  window.told = [];
  window.view = createScene(document.getElementById("scene"), replay, {
    onLost: () => told.push("lost"), onRestored: () => told.push("restored"), keepPicture: true, ...options,
  });
  view.draw(replay, 0);
}"""


def track_of(slug: str) -> TrackGeometry:
    return next(entry for entry in CATALOGUE if entry.slug == slug).geometry()


def drive(track: TrackGeometry, rules: RaceRules, *, blind: bool = False, **pilot: Any) -> RaceResult:
    """A race of one car that follows the centre line; ``blind``: into the boxes."""
    layout = {} if blind else {"layout": lay_out(track.in_direction(rules.direction), rules)}
    driver = CentreLinePilot(track, direction=rules.direction, **layout, **pilot)
    return run_race(RaceSettings(track, rules, [Entrant(driver.action_space, driver.sensors, driver)]))


def run_document(
    result: RaceResult, name: str = "flyer", shell: str = "wedge", colour: str = "#ef4444"
) -> dict[str, Any]:
    trace = result.trace
    columns = {
        "t": [round(1000 * (stamp - trace["tstamp"][0])) for stamp in trace["tstamp"].tolist()],
        "x": trace["X"].round(4).tolist(),
        "y": trace["Y"].round(4).tolist(),
        "yaw": trace["yaw"].round(2).tolist(),
        "v": trace["throttle"].round(2).tolist(),
        "steer": trace["steer"].round(1).tolist(),
        "lap": (trace["episode"] + 1).tolist(),
        "status": trace["episode_status"].tolist(),
        "progress": trace["progress"].round(3).tolist(),
        "on_track": trace["all_wheels_on_track"].tolist(),
    }
    bots = result.layout.get("bots", [])
    return {
        **{"run": name, "name": name, "href": "#", "look": {"shell": "wedge", "colour": "#ef4444"}},
        **{"laps": [], "columns": columns, "rivals": [], "events": []},
        "boxes": [{**box, "yaw": math.degrees(box["yaw"])} for box in result.layout["boxes"]],
        "bots": [
            {axis: [scale * place[n] for place in bot] for n, (axis, scale) in enumerate(_AXES.items())} for bot in bots
        ],
    }


_AXES = {"x": 1.0, "y": 1.0, "yaw": 180 / math.pi}


def scene_document(track: TrackGeometry, direction: str) -> dict[str, Any]:
    return the_sites_document(_Row(track), direction)  # type: ignore[arg-type]


class _Row(NamedTuple):
    """What a scene document reads of a track's row."""

    geometry: TrackGeometry
    slug: str = "track"
    name: str = "Track"


def open_scripts(page: Any) -> None:
    """A page of its own with an empty canvas and the site's static files."""
    static = CHECKOUT / "static"

    def answer(route: Any) -> None:
        path = static / route.request.url.removeprefix(f"{SITE}/static/")
        kind = "application/json" if path.suffix == ".json" else "text/javascript"
        route.fulfill(body=path.read_bytes(), content_type=kind)

    page.route(f"{SITE}/", lambda route: route.fulfill(body=PAGE, content_type="text/html"))
    page.route(f"{SITE}/static/**", answer)
    page.goto(f"{SITE}/")


def open_scene(page: Any, scene: dict[str, Any], documents: list[dict[str, Any]], **options: Any) -> None:
    """A page with the scene of a replay: ``view`` and ``replay`` are in its window."""
    open_scripts(page)
    page.evaluate(OPEN, {"scene": scene, "documents": documents, "options": options})
