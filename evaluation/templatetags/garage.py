"""How the garage shows a model's metadata."""

import json
import math

from django import template
from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from core.streams.shared_pieces import lasting_piece
from evaluation.garage.selectors import algorithm_of
from evaluation.models import TrainedModel
from paddock.packages.inputs import SENSORS

register = template.Library()

RADIUS = 100.0  # of the fan, in its own units
TOP_SPEED_MPS = 4.0
SENSOR_WORDS = {name: sensor.label for name, sensor in SENSORS.items()}


@register.simple_tag
def abilities(model: TrainedModel) -> SafeString:
    """What a model can do and see, drawn once for all readers."""
    key = model.public_id, repr(model.metadata)
    return lasting_piece("evaluation/garage/abilities.html", {"model": model}, key=key)


@register.filter
def sensor_name(sensor: str) -> str:
    """A sensor's name in the reader's language; the field's own name when there is none."""
    return _(SENSOR_WORDS[sensor]) if sensor in SENSOR_WORDS else sensor


@register.filter
def sensor_list(model: TrainedModel) -> str:
    return ", ".join(sensor_name(sensor) for sensor in model.sensors)


@register.filter
def action_count(metadata: dict) -> str:
    """The action space in a few words."""
    space = metadata.get("action_space")
    if isinstance(space, list):
        return ngettext("%(count)s action", "%(count)s actions", len(space)) % {"count": len(space)}
    return _("continuous")


@register.filter
def algorithm(metadata: dict) -> str:
    """What trained the network; ``""`` where its metadata do not tell."""
    return algorithm_of(metadata)


@register.filter
def is_discrete(metadata: dict) -> bool:
    return isinstance(metadata.get("action_space"), list)


@register.filter
def pretty_json(value: object) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False)


@register.simple_tag
def action_fan(metadata: dict) -> SafeString:
    """The action space as a fan: a ray's direction is the steering angle, its length the speed (the rim is 4 m/s)."""
    space = metadata.get("action_space")
    rim = format_html('<path class="fan-rim" d="{}"/>', _arc(-30, 30, RADIUS))
    half = format_html('<path class="fan-rim" d="{}"/>', _arc(-30, 30, RADIUS / 2))
    if isinstance(space, list):
        rays = sorted(((float(a["steering_angle"]), float(a["speed"])) for a in space), key=lambda ray: -ray[1])
        inside = format_html_join(
            "",
            '<line class="fan-ray" x1="0" y1="0" x2="{0}" y2="{1}"/>'
            '<circle class="fan-tip" cx="{0}" cy="{1}" r="2.6"/>',
            (_point(angle, speed) for angle, speed in rays),
        )
    else:
        space = space or {}
        angle, speed = space["steering_angle"], space["speed"]
        inside = format_html('<path class="fan-area" d="{}"/>', _ring(angle, speed))
    return format_html(
        '<svg class="fan" viewBox="-66 -108 132 118" role="img"><title>{}</title>{}{}{}</svg>',
        _("Action space: direction is steering, length is speed; the rim is 4 m/s."),
        rim,
        half,
        inside,
    )


def _clip(angle: float, speed: float) -> tuple[float, float]:
    """What the car makes of an action (paddock.simulator.action): 30 degrees and 0.1 to 4 m/s at most."""
    return max(-30.0, min(30.0, angle)), max(0.1, min(TOP_SPEED_MPS, speed))


def _point(angle: float, speed: float) -> tuple[str, str]:
    """Where the ray of an action ends; positive steering is to the left, straight on is up."""
    angle, speed = _clip(angle, speed)
    length = RADIUS * speed / TOP_SPEED_MPS
    turn = math.radians(angle)
    return f"{-length * math.sin(turn):.1f}", f"{-length * math.cos(turn):.1f}"


def _arc(low: float, high: float, radius: float) -> str:
    speed = TOP_SPEED_MPS * radius / RADIUS
    (x1, y1), (x2, y2) = _point(high, speed), _point(low, speed)
    return f"M{x1},{y1}A{radius:g},{radius:g} 0 0 1 {x2},{y2}"


def _ring(angle: dict, speed: dict) -> str:
    low, slow = _clip(float(angle["low"]), float(speed["low"]))
    high, fast = _clip(float(angle["high"]), float(speed["high"]))
    outer, inner = RADIUS * fast / TOP_SPEED_MPS, RADIUS * slow / TOP_SPEED_MPS
    corners = [_point(high, fast), _point(low, fast), _point(low, slow), _point(high, slow)]
    (a, b), (c, d), (e, f), (g, h) = corners
    return f"M{a},{b}A{outer:.1f},{outer:.1f} 0 0 1 {c},{d}L{e},{f}A{inner:.1f},{inner:.1f} 0 0 0 {g},{h}Z"
