"""Reason codes of courses."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Courses",
    not_found={
        "class_learner_unknown": _("An alias is no learner of this class. Nothing was changed."),
    },
)
