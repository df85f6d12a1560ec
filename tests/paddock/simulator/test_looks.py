"""A track's look is what cameras see of it, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from paddock.geometry.catalogue import by_slug
from paddock.simulator.camera.theme import THEMES
from paddock.simulator.camera.view import Camera, Scene
from paddock.simulator.car import Pose
from tracks.models import TrackLook

OVAL = by_slug("oval").geometry()


def frame(look: str) -> np.ndarray:
    return Camera(Scene.of(OVAL, THEMES[look])).render(Pose(*OVAL.point_at(0.0)))


def test_every_look_of_a_track_can_be_drawn() -> None:
    assert set(THEMES) == set(TrackLook.values)
    assert all(theme.name == name for name, theme in THEMES.items())
    assert TrackLook("official") == "official"


def test_every_look_gives_a_different_picture() -> None:
    pictures = {look: frame(look).tobytes() for look in THEMES}
    assert len(set(pictures.values())) == len(THEMES)


@pytest.mark.parametrize("look", sorted(THEMES))
def test_a_picture_has_the_greys_of_its_look(look: str) -> None:
    theme = THEMES[look]
    seen = frame(look)
    for grey in (theme.road, theme.field, theme.wall):
        assert (np.abs(seen.astype(int) - grey) <= 2).mean() > 0.01
