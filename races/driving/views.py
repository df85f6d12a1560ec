"""The page on which a visitor drives."""

import json
from collections.abc import Collection
from dataclasses import asdict
from typing import NamedTuple

from django.contrib.auth.models import AnonymousUser
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.urls import reverse
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from accounts.models import Racer
from evaluation.appearance.looks import Shell, VehicleLook
from evaluation.models import Evaluation, State, TrainedModel
from paddock.geometry.track import CCW, CW
from paddock.rules.race import RaceRules
from paddock.simulator.physics import PADDOCK_CAR
from races.entries.selectors.visibility import evaluations_visible_to
from races.replays.comparison import best_lap
from races.replays.document import look_document
from races.replays.reference import viewed_reference
from races.replays.selectors import driven_in, without_races
from races.spoilers.selectors import spoilers_of
from tracks.models import Track
from tracks.reference.selectors import reference_lap

GHOSTS = 12
_LOOKED_AT = 60  # the fastest runs, of which each racer's first is a ghost


class GhostOffer(NamedTuple):
    """A run, and its best lap."""

    run: Evaluation
    lap: int


def ghosts_on(
    track: Track, direction: str, reader: Racer | AnonymousUser, hidden: Collection[int] = ()
) -> list[GhostOffer]:
    """The fastest visible run of each racer on the track in the direction, the fastest first. ``hidden``: races whose
    results are spoilers."""
    runs = evaluations_visible_to(reader).filter(
        driven_in(direction), track=track, state=State.FINISHED, result__best_lap_ms__isnull=False
    )
    runs = without_races(runs, hidden)
    runs = runs.select_related("result").defer("result__trajectory", "track__npy")
    found: dict[int | None, Evaluation] = {}
    for run in runs.order_by("result__best_lap_ms", "pk")[:_LOOKED_AT]:
        found.setdefault(run.owner_id, run)
    return [GhostOffer(run, best_lap(run.result.laps)) for run in list(found.values())[:GHOSTS]]


@require_safe
def drive(request: HttpRequest, slug: str) -> HttpResponse:
    """The track to drive on. ``direction``: ``ccw`` or ``cw``; ``ghost``: the id of a run to drive against, or
    ``none``."""
    track = get_object_or_404(Track, slug=slug, length_m__isnull=False)
    direction = request.GET.get("direction", track.direction)
    if direction not in (CCW, CW):
        raise Http404
    ghosts = ghosts_on(track, direction, request.user, spoilers_of(request).hidden)
    reference = reference_lap(track, direction)
    asked = request.GET.get("ghost", "")
    chosen = next((ghost.run.public_id for ghost in ghosts if ghost.run.public_id == asked), None)
    context = {
        "track": track,
        "direction": direction,
        "other_direction": CW if direction == CCW else CCW,
        "ghosts": ghosts,
        "reference": reference,
        "reference_run": viewed_reference(reference) if reference is not None else None,
        "chosen": chosen or (ghosts[0].run.public_id if ghosts and asked != "none" else ""),
        "setup": json.dumps(_setup(request, track, direction)),
    }
    return render(request, "races/driving/drive.html", context)


def _setup(request: HttpRequest, track: Track, direction: str) -> dict[str, object]:
    return {
        "scene": f"{reverse('track_scene', args=[track.slug])}?direction={direction}",
        "physics": asdict(PADDOCK_CAR),
        "penalty_ms": RaceRules().off_track_penalty_ms,
        "look": look_document(_look(request)),
        "words": {
            "you": _("You"),
            "lap": _("Lap"),
            "ready": _("Press the up arrow to start."),
            "ready_touch": _("Hold ▲ to start."),
            "no_tilt": _("The browser does not allow this page to read the tilt of the phone."),
            "off_track": _("Off track. Wait for the reset."),
            "failed": _("The page could not load the track or the ghost."),
        },
    }


def _look(request: HttpRequest) -> VehicleLook:
    """That of the visitor's newest model, else one that no ghost has by default."""
    model = TrainedModel.objects.filter(owner=request.user.pk).order_by("-pk").first()
    return model.look if model is not None else VehicleLook(Shell.WEDGE.value, "#ff3b55")
