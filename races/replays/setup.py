"""The setup of a viewer: which runs it plays on which track, and its words in the reader's language."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NotRequired, TypedDict

from django.conf import settings
from django.urls import reverse
from django.utils.translation import gettext as _
from django.utils.translation import pgettext

from evaluation.models import Evaluation
from tracks.models import Track

from .selectors import direction_of

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


class ViewedRun(TypedDict):
    """A run of a viewer: the address of its document or the document itself, the lap that its clock begins with (0: the
    run), and its name and look where they differ from the document's."""

    url: NotRequired[str]
    document: NotRequired[Mapping[str, object]]
    lap: int
    name: NotRequired[str]
    look: NotRequired[dict[str, str]]


def viewer_setup(
    scene: str,
    runs: Sequence[ViewedRun],
    *,
    together: str = "",
    page: str = "",
    quiet: bool = False,
    clip: str = "",
    **more: Any,
) -> str:
    """The JSON for the include ``races/replays/viewer.html``. ``scene``: the address of the scene document;
    ``together``: that of one answer with all of these documents by their addresses; ``page``: that of the viewer's
    page, for links to a moment; ``quiet``: play at once, over and over, without controls; ``clip``: the page that makes
    clips of the first run, for readers who may."""
    own = {"together": together, "page": page, "quiet": quiet, "clip": clip, "words": words()}
    return json.dumps({"scene": scene, "runs": list(runs), **own, **more})


def run_setup(shown: Evaluation, lap: int = 0, reader: Racer | AnonymousUser | None = None) -> str:
    """The viewer of one run. ``reader``: may make clips of it if logged in."""
    return viewer_setup(
        scene_address(shown),
        [{"url": document_address(shown), "lap": lap}],
        page=reverse("replay", args=[shown.public_id]),
        clip=clip_address(shown, reader),
    )


def clip_address(run: Evaluation, reader: Racer | AnonymousUser | None) -> str:
    """The page with the form of a run's clips; "" for readers without that right. The caller checks that the run is
    visible."""
    return run.get_absolute_url() if settings.VIDEOS and reader is not None and reader.is_authenticated else ""


def document_address(run: Evaluation) -> str:
    return reverse("evaluation_replay", args=[run.public_id])


def scene_address(run: Evaluation) -> str:
    return address_of_scene(run.track, direction_of(run))


def address_of_scene(track: Track, direction: str) -> str:
    return f"{reverse('track_scene', args=[track.slug])}?direction={direction}"


def words() -> dict[str, str]:
    """The texts that scripts write."""
    return {
        "play": _("Play"),
        "pause": _("Pause"),
        "lap": _("Lap"),
        "failed": _("The replay could not be loaded."),
        "lost": _("%s is missing: its replay could not be loaded."),
        "no3d": _("This browser shows no 3D graphics. The map shows the same."),
        "contextLost": _("The 3D view stopped. The map goes on."),
        "copied": _("Link copied"),
        "leads": _("leads"),
        "follow": _("Follow %s"),
        "out": _("out"),
        "map": _("Map"),
        "chase": pgettext("camera", "Chase"),
        "onboard": pgettext("camera", "Onboard"),
        "top": pgettext("camera", "From above"),
        "trackside": pgettext("camera", "Trackside"),
        "free": pgettext("camera", "Free"),
        "difference": _("Next difference"),
        "off_track": _("Next off-track"),
        "overtake": _("Next overtake"),
        "crash": _("Next crash"),
    }
