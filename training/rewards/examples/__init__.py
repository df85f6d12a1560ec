"""Reward functions to begin with: each a file beside this one. Titles and explanations are shown translated."""

from __future__ import annotations

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
            "because every moment says whether it is good; not the fastest, because the centre line is not."
        ),
    ),
    Example(
        "stay_inside_borders",
        _("Stay inside the borders"),
        _(
            "Anything is right as long as all wheels are on the road and 5 cm from the border. The car may find a line "
            "of its own, but nothing tells it to hurry."
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
            "Pays the metres gained in every step, so that a fast car earns more, and less close to the border. It "
            "takes longer to learn than the centre line and ends in far better lap times. It remembers the step "
            "before; each car in training has a memory of its own."
        ),
    ),
)


def example(slug: str) -> Example:
    """The example of this name. Raises KeyError."""
    return {one.slug: one for one in EXAMPLES}[slug]


DEFAULT = EXAMPLES[0]
