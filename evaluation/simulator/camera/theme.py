"""How a track looks. Greys are the luma (0-255) that the official simulator's picture has after its own grey filter."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Theme:
    """The look of a track and of the hall it lies in. Lengths in metres, greys 0-255."""

    name: str
    road: int
    line: int
    dash: int
    field: int
    wall: int
    sky: int
    line_width: float  # border lines, inside the road
    dash_length: float
    dash_width: float
    dash_pitch: float  # from the start of a dash to the start of the next
    field_margin: float  # from the bounding box of the borders to the wall
    wall_height: float


# Measured on the reInvent2019_wide mesh of deepracer-simapp and the mean luma of its textures; the background is
# Gazebo's default grey of 0.7.
OFFICIAL = Theme(
    name="official",
    road=63,
    line=223,
    dash=151,
    field=123,
    wall=61,
    sky=178,
    line_width=0.0762,
    dash_length=0.0508,
    dash_width=0.0254,
    dash_pitch=0.1016,
    field_margin=0.762,
    wall_height=1.0,
)

# The look of the three frames that come with deepracer-utils (dr-demo-1..3): dark hall, high walls, double-size dashes.
HALL = Theme(
    name="hall",
    road=52,
    line=211,
    dash=142,
    field=135,
    wall=14,
    sky=178,
    line_width=0.0762,
    dash_length=0.1016,
    dash_width=0.0508,
    dash_pitch=0.2032,
    field_margin=1.5,
    wall_height=4.0,
)

THEMES = {theme.name: theme for theme in (OFFICIAL, HALL)}
