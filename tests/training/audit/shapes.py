"""Reward functions of the kinds that racers publish, each in its shortest form, by name."""

from __future__ import annotations

HEAD = "def reward_function(params):\n"


def of(body: str, above: str = "") -> str:
    """A function of one expression or of lines, with ``above`` before it."""
    if "\n" not in body and not body.startswith(("return", "if", "raise")):
        body = f"return {body}"
    return above + HEAD + "".join(f"    {line}\n" for line in body.splitlines())


# the field's own three, and what is made of them
BANDS = """d, w = params["distance_from_center"], params["track_width"]
if d <= 0.1 * w:
    return 1.0
if d <= 0.25 * w:
    return 0.5
return 0.1 if d <= 0.5 * w else 1e-3"""
BORDERS = """room = 0.5 * params["track_width"] - params["distance_from_center"]
return 1.0 if params["all_wheels_on_track"] and room >= 0.05 else 1e-3"""
HEADING = """points, (before, after) = params["waypoints"], params["closest_waypoints"]
(x0, y0), (x1, y1) = points[before], points[after]
direction = math.degrees(math.atan2(y1 - y0, x1 - x0))
off = abs(direction - params["heading"])
off = 360 - off if off > 180 else off
return 1.0 if off <= 10 else 0.5"""
LINE = """points = params["waypoints"]
here = (params["x"], params["y"])
nearest = min(math.dist(point, here) for point in points)
return math.exp(-4 * nearest)"""
LINE_AND_PACE = """nearest = min(math.dist(point, (params["x"], params["y"])) for point in params["waypoints"])
return math.exp(-4 * nearest) * math.exp(params["speed"] / 2)"""
KEPT = "before = {'steps': 0, 'progress': 0.0}\n\n\n"
GAIN = """goes_on = params["steps"] > before["steps"]
gained = params["progress"] - before["progress"] if goes_on else 0.0
before.update(steps=params["steps"], progress=params["progress"])
return gained"""
GAIN_FOR_EVER = """global last
gained = params["progress"] - last
last = params["progress"]
return gained"""
POTENTIAL = """new = params["progress"] / 100
old = before["progress"] if params["steps"] > before["steps"] else 0.0
before.update(steps=params["steps"], progress=new)
return 0.97 * new - old"""
SMOOTH = """change = abs(params["steering_angle"] - before["progress"])
before["progress"] = params["steering_angle"]
return 1.0 - change / 60"""
OBJECTS = """ahead = params["closest_objects"][1]
x, y = params["objects_location"][ahead]
return 1.0 if math.dist((params["x"], params["y"]), (x, y)) > 0.5 else 0.1"""
OBJECTS_ASKED_FOR = """if params["objects_location"]:
    x, y = params["objects_location"][params["closest_objects"][1]]
    if math.dist((params["x"], params["y"]), (x, y)) < 0.5:
        return 0.1
return 1.0 if params["all_wheels_on_track"] else 0.001"""
MILESTONES = """if params["steps"] % 50 == 0 and params["progress"] > params["steps"] * 100 / 200:
    return 10.0
return 0.01"""
BEND_PACE = """points, (before, after) = params["waypoints"], params["closest_waypoints"]
(x0, y0), (x1, y1) = points[before], points[(after + 4) % len(points)]
turn = abs(math.remainder(math.degrees(math.atan2(y1 - y0, x1 - x0)) - params["heading"], 360))
wanted = 4.0 if turn < 10 else 2.0
return max(1.0 - abs(params["speed"] - wanted) / 4, 0.001)"""
CLASS = """class Coach:
    def __init__(self):
        self.steps = 0

    def __call__(self, params):
        self.steps = params["steps"]
        return params["speed"] / 4 if params["all_wheels_on_track"] else 0.0


reward_function = Coach()
"""
OF_2018 = """def reward_function(on_track, x, y, distance_from_center, car_orientation, progress, steps,
                    throttle, steering, track_width, waypoints, closest_waypoint):
    return throttle if on_track else 0.0
"""

SHAPES = {
    "centre line in bands": of(BANDS),
    "centre line, linear": of('max(1 - 2 * params["distance_from_center"] / params["track_width"], 0.001)'),
    "centre line, bell": of('math.exp(-20 * params["distance_from_center"] ** 2)', "import math\n\n\n"),
    "inside the borders": of(BORDERS),
    "all wheels on track alone": of('1.0 if params["all_wheels_on_track"] else 0.001'),
    "a constant": of("1.0"),
    "nothing": of("0.0"),
    "speed alone": of('params["speed"]'),
    "speed squared": of('params["speed"] ** 2'),
    "speed, exponential": of('math.exp(params["speed"])', "import math\n\n\n"),
    "speed on the road": of('params["speed"] if params["all_wheels_on_track"] else 0.001'),
    "speed, minus ten off the road": of('-10.0 if params["is_offtrack"] else params["speed"]'),
    "speed above a threshold": of('1.0 if params["speed"] > 1.5 else 0.1'),
    "centre line plus speed": of('1 - 2 * params["distance_from_center"] / params["track_width"] + params["speed"]'),
    "centre line times speed": of('(1 - params["distance_from_center"] / params["track_width"]) * params["speed"]'),
    "pace for the bend": of(BEND_PACE, "import math\n\n\n"),
    "progress over steps": of('100 * params["progress"] / params["steps"]'),
    "progress so far": of('params["progress"]'),
    "progress gained": of(GAIN, KEPT),
    "progress gained, never reset": of(GAIN_FOR_EVER, "last = 0.0\n\n\n"),
    "potential with discount": of(POTENTIAL, KEPT),
    "progress minus time": of(GAIN.replace("return gained", "return gained - 0.5"), KEPT),
    "heading of the waypoints": of(HEADING, "import math\n\n\n"),
    "line of points": of(LINE, "import math\n\n\n"),
    "line of points and pace": of(LINE_AND_PACE, "import math\n\n\n"),
    "steering penalty": of('0.8 if abs(params["steering_angle"]) > 15 else 1.0'),
    "smooth steering": of(SMOOTH, KEPT),
    "left lane": of('1.0 if params["is_left_of_center"] else 0.1'),
    "reward by steps": of('float(params["steps"])'),
    "reward by time": of('params["sim_time"]'),
    "survive": of('-10.0 if params["is_offtrack"] or params["is_crashed"] else 1.0'),
    "sparse lap bonus": of('100.0 if params["progress"] == 100 else 0.0'),
    "lap bonus by steps": of('1e5 / params["steps"] if params["progress"] == 100 else 0.0'),
    "constant and lap bonus": of('5000.0 if params["progress"] == 100 else 1.0'),
    "milestones": of(MILESTONES),
    "minus one a step": of("-1.0"),
    "minus one a step, minus hundred off": of('-100.0 if params["is_offtrack"] else -1.0'),
    "minus the distance": of('-1 - params["distance_from_center"]'),
    "slowness": of('1 / params["speed"]'),
    "careful": of('1.0 if params["speed"] <= 1.2 else 0.1'),
    "steering as such": of('abs(params["steering_angle"]) / 30'),
    "steering times speed": of('abs(params["steering_angle"]) * min(params["speed"], 1.0)'),
    "not reversed": of('0.0 if params["is_reversed"] else 1.0'),
    "objects asked for": of(OBJECTS_ASKED_FOR, "import math\n\n\n"),
    "a class": CLASS,
    "the form of 2018": OF_2018,
    # with faults
    "objects where none are": of(OBJECTS, "import math\n\n\n"),
    "misspelt": of('params["distance_from_centre"]'),
    "a default for nothing": of('params.get("velocity", 1.0)'),
    "foreign, behind a condition": of(
        'if params["progress"] > 200:\n    return params["lap_time"]\nreturn params["speed"]'
    ),
    "nothing on one way": of('if params["speed"] > 1.5:\n    return params["speed"]'),
    "not a number": of('float("nan") if params["progress"] > 50 else 1.0'),
    "infinite": of('float("inf") if params["progress"] > 50 else 1.0'),
    "a text": of('"fast" if params["speed"] > 1.5 else 1.0'),
    "complex": of('(params["distance_from_center"] - 0.1) ** 0.5'),
    "too large": of('1e6 * params["speed"]'),
    "division by zero": of('1 / (params["steps"] - 10)'),
    "random": of("0.9 + random.random() / 10", "import random\n\n\n"),
}
