"""The parts of the wizard that are the same for every reader: each is drawn once for the same values."""

from django.template.loader import render_to_string
from django.utils.safestring import SafeString

from core.streams.shared_pieces import shared_piece
from paddock.rules.hyperparameters import HYPERPARAMETERS
from paddock.rules.training import ENDING, RANDOMISED
from races.rules.layout_form import preview

from ..lessons.catalogue import LESSON_CODE
from ..rewards.examples import EXAMPLES
from ..rewards.views import EditorReport
from .forms import GRANULARITIES, LAYOUT, RANGES, SettingsForm
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
# Any other reward function is the reader's own.
_PUBLIC_CODE = {*(example.code for example in EXAMPLES), *LESSON_CODE.values()}


def parts_of(
    form: SettingsForm,
    tried: SweepForm,
    *,
    submitted: bool,
    checked: EditorReport | None,
    audit: dict[str, object] | None,
) -> dict[str, SafeString]:
    """The HTML of the parts by their names."""
    if form.is_bound:
        context = {"alike": form, "tried": tried, "layout": preview(form, submitted=submitted)}
        context |= {"examples": EXAMPLES, "checked": checked, "audit": audit}
        return {name: render_to_string(_template(name), context) for name in (*_FIELDS, "sweep_fields")}
    sweep_fields = shared_piece(_template("sweep_fields"), lambda: {"tried": SweepForm(owner=None)}, key="wizard")
    return {"sweep_fields": sweep_fields} | {name: _unsent(name, form) for name in _FIELDS}


def _unsent(name: str, form: SettingsForm) -> SafeString:
    values = {field: form.get_initial_for_field(form.fields[field], field) for field in _FIELDS[name]}

    def context() -> dict[str, object]:
        alike = SettingsForm(initial=values)
        layout = preview(alike, submitted=False) if name == "where" else None
        return {"alike": alike, "examples": EXAMPLES, "layout": layout}

    if name == "reward" and values["reward_code"] not in _PUBLIC_CODE:
        return render_to_string(_template(name), context())
    return shared_piece(_template(name), context, key=repr(values))


def _template(name: str) -> str:
    return f"training/wizard/parts/{name}.html"
