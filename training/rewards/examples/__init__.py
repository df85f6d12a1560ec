"""Reward functions to begin with: each a file beside this one. Titles and explanations are shown translated."""

import functools
from dataclasses import dataclass
from pathlib import Path

from paddock.errors.reasons import gettext_noop as _
from paddock.rules.race import HEAD_TO_HEAD, OBJECT_AVOIDANCE, RACE_TYPES

_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Example:
    """One example. ``slug``: its file's name. ``title`` and ``explanation`` in English, marked for translation.
    ``race_types``: what it is made for."""

    slug: str
    title: str
    explanation: str
    race_types: tuple[str, ...] = RACE_TYPES

    @functools.cached_property
    def code(self) -> str:
        """The text of the function."""
        return (_HERE / f"{self.slug}.py").read_text(encoding="utf-8")


EXAMPLES = (
    Example(
        "follow_centre_line",
        _("Follow the centre line"),
        _(
            "The car gets most close to the centre line and less in two steps towards the borders. Easy to learn, "
            "because every step shows whether it is good; not the fastest, because the centre line is not."
        ),
    ),
    Example(
        "stay_inside_borders",
        _("Stay inside the borders"),
        _(
            "Rewards any position with all wheels on the road, 5 cm from the border. The car is free to find its "
            "own line, but has no reason to hurry."
        ),
    ),
    Example(
        "prevent_zig_zag",
        _("Prevent zig-zag"),
        _(
            "Follows the centre line, and takes a fifth away for steering by more than 15 degrees. Cars that are paid "
            "for the place alone often sway from one side to the other; this one does it less."
        ),
    ),
    Example(
        "follow_direction",
        _("Follow the track's direction"),
        _(
            "Compares the car's heading with the direction of the road at the nearest waypoints, and takes half away "
            "beyond 10 degrees. It helps a car that turns into bends too late."
        ),
    ),
    Example(
        "stay_in_lane_without_crashing",
        _("Stay in lane without crashing"),
        _(
            "For boxes and bot cars: stay on the road, and be in the other lane when something comes near in this one. "
            "Not to crash counts four times as much."
        ),
        (OBJECT_AVOIDANCE, HEAD_TO_HEAD),
    ),
    Example(
        "race",
        _("Race"),
        _(
            "Rewards the metres gained in each step, and less near the border, so a fast car earns more. Learns "
            "more slowly than the centre line, with far better lap times. It remembers the previous step; each "
            "car in training has a separate memory."
        ),
    ),
)


def example(slug: str) -> Example:
    """The example of this name. Raises KeyError."""
    return {one.slug: one for one in EXAMPLES}[slug]


DEFAULT = EXAMPLES[0]
