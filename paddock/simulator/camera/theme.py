"""The look of a track, in greys as the official simulator's picture has after its grey filter."""

# Greys are the luma, 0-255.

from dataclasses import dataclass, replace

Faces = tuple[int, int, int, int]  # greys of a block's front, left, back and right


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
    box: Faces
    car: Faces
    car_window: int
    car_wheel: int
    line_width: float  # border lines, inside the road
    dash_length: float
    dash_width: float
    dash_pitch: float  # from the start of a dash to the start of the next
    field_margin: float  # from the bounding box of the borders to the wall
    wall_height: float


# Shapes: measured on the reInvent2019_wide mesh of deepracer-simapp; they agree with three frames of its camera
# (dr-demo-1..3 of deepracer-utils). Greys: medians on those frames, as light changes the textures. Sky: Gazebo's
# background. Boxes and cars are chosen: a box lighter than the road and darker than the field, a car darker than the
# road, with faces that differ as the walls do.
OFFICIAL = Theme(
    name="official",
    road=53,
    line=212,
    dash=140,
    field=134,
    wall=14,
    sky=178,
    box=(104, 84, 96, 78),
    car=(30, 24, 28, 20),
    car_window=92,
    car_wheel=6,
    line_width=0.0762,
    dash_length=0.0508,
    dash_width=0.0254,
    dash_pitch=0.1016,
    field_margin=0.762,
    wall_height=1.0,
)

# The greys of the mesh's own textures, before any light falls on them (deepracer-simapp, reInvent2019_wide).
TEXTURES = replace(OFFICIAL, name="textures", road=63, line=223, dash=151, field=123, wall=61)

# The look of newer tracks of the official simulator: larger dashes, and a larger and higher hall.
BOLD = replace(
    OFFICIAL,
    name="bold",
    dash_length=0.1016,
    dash_width=0.0508,
    dash_pitch=0.2032,
    field_margin=1.5,
    wall_height=4.0,
)

THEMES = {theme.name: theme for theme in (OFFICIAL, TEXTURES, BOLD)}  # a track names one: tracks.models.TrackLook
