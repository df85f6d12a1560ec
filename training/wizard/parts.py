"""The parts of the wizard that are the same for every reader: each is drawn once for the same values."""

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from django.forms import BoundField
from django.template.loader import render_to_string
from django.utils.functional import SimpleLazyObject
from django.utils.safestring import SafeString

from core.streams.shared_pieces import lasting_piece, shared_piece
from paddock.rules.hyperparameters import HYPERPARAMETERS
from paddock.rules.training import ENDING, RANDOMISED
from races.rules.layout_form import preview

from ..lessons.catalogue import LESSON_CODE
from ..models import Vehicle
from ..rewards.examples import EXAMPLES
from ..rewards.views import EditorReport
from .fields import TRAINING, OwnRows
from .forms import GRANULARITIES, LAYOUT, RANGES, SettingsForm, TrainingForm
from .sweep import SweepForm

# The fields whose values each part shows.
_FIELDS: dict[str, tuple[str, ...]] = {
    "what": ("name", "description"),
    "where": ("track", "direction", "race_type", "box_choice", "opponents", *LAYOUT, "seed"),
    "track_ticks": ("more_tracks",),
    "episodes": ("alternate_direction", *RANDOMISED),
    "how": ("algorithm", "usual_of", *HYPERPARAMETERS, "seed"),
    "actions": ("action_space_type", *GRANULARITIES, "actions", *RANGES),
    "reward": ("reward_code",),
    "ending": (*ENDING, "standing_laps"),
    "evaluate_on": ("evaluate_on",),
}
# The fields with something of the reader's own, each with its template, and what it shows of its choices.
_OF_VEHICLE = attrgetter("public_id", "name", "sensors", "neural_network", "shell", "colour")
_OF_RACE = attrgetter("slug", "name", "track.slug", "track.name", "race_type", "direction")


def _read_once(field: Any) -> list[Any]:
    """The choices, which the widget takes over: read once more they could be others than in the key of the piece."""
    field.widget.choices = choices = list(iter(field.choices))  # of their number it asks the database
    return choices


_OWN: dict[str, tuple[str, Callable[[Any], list[Any]]]] = {
    "start": ("training/wizard/parts/start.html", lambda field: field.choices),
    "clone": ("parts/field.html", _read_once),
    "vehicle": ("training/wizard/parts/vehicle.html", lambda field: list(map(_OF_VEHICLE, field.offered))),
    "submit_to_race": ("parts/field.html", lambda field: list(map(_OF_RACE, field.offered))),
}
# Any other reward function is the reader's own.
_PUBLIC_CODE = {*(example.code for example in EXAMPLES), *LESSON_CODE.values()}


def parts_of(
    form: TrainingForm,
    tried: SweepForm | None,
    read: OwnRows,
    *,
    submitted: bool,
    checked: EditorReport | None,
    audit: dict[str, object] | None,
) -> dict[str, SafeString]:
    """The HTML of the parts by their names."""
    own = {name: _own(form[name], *_OWN[name]) for name in _OWN}
    if tried is not None:
        context = {"alike": form, "tried": tried, "layout": preview(form, submitted=submitted)}
        context |= {"examples": EXAMPLES, "checked": checked, "audit": audit}
        parts = {name: render_to_string(_template(name), context) for name in (*_FIELDS, "sweep_fields")}
        return parts | own | {"rewards": render_to_string("parts/field.html", {"field": tried["rewards"]})}
    trainings = [row[1:3] for row in read.rows if row[0] == TRAINING]
    field = {"field": SimpleLazyObject(lambda: SweepForm(owner=read.racer, read=read)["rewards"])}
    own["rewards"] = lasting_piece("parts/field.html", field, key=("rewards", *trainings))
    sweep_fields = shared_piece(_template("sweep_fields"), lambda: {"tried": SweepForm(owner=None)}, key="wizard")
    return {"sweep_fields": sweep_fields} | own | {name: _unsent(name, form) for name in _FIELDS}


def _own(field: BoundField, template: str, shown: Callable[[Any], list[Any]]) -> SafeString:
    values = {"field": field, "quiet": True, "original": Vehicle}
    if field.form.is_bound:
        return render_to_string(template, values)
    choices, value = repr(shown(field.field)), str(field.value() or "")
    # an address may hold any value, and of one that is not offered nothing is chosen
    chosen = value if not value or repr(value) in choices else None
    return lasting_piece(template, values, key=(field.name, chosen, choices))


def _unsent(name: str, form: SettingsForm) -> SafeString:
    values = {field: form.get_initial_for_field(form.base_fields[field], field) for field in _FIELDS[name]}

    def context() -> dict[str, object]:
        alike = SettingsForm(initial=values)
        layout = preview(alike, submitted=False) if name == "where" else None
        return {"alike": alike, "examples": EXAMPLES, "layout": layout}

    if name == "reward" and values["reward_code"] not in _PUBLIC_CODE:
        return render_to_string(_template(name), context())
    return shared_piece(_template(name), context, key=repr(values))


def _template(name: str) -> str:
    return f"training/wizard/parts/{name}.html"
