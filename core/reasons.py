"""Reason codes of the ground floor."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    unavailable={
        "cards_busy": _("The site draws many pictures now. Ask for this one again in a minute."),
        "database_not_ready": _(
            "The database is not ready: %(problem)s. Run “manage.py setup” (“manage.py run” does "
            "this automatically), or check DATABASE_URL and PADDOCK_DATA."
        ),
        "internal_error": _("Internal error. Your model is fine; the run will be repeated."),
        "storage_failed": _(
            "A stored file could not be read or written. Your model is fine; the run will be repeated."
        ),
    },
)

register(
    "Programs",
    invalid={
        "unknown_field": _("Unknown field %(field)s. Known fields: %(known)s."),
        "no_fields": _("This operation takes no fields. Send it without a body."),
    },
)

register(
    "Texts",
    invalid={
        "text_character": _(
            "Type this text again. It contains the character %(character)s, which is invisible or has no meaning in "
            "Unicode."
        ),
        "one_line": _("Enter the text on one line."),
    },
)

register(
    "Commands",
    invalid={
        "command_line": _("Invalid command line: %(problem)s. Run the command with --help."),
        "file_unreadable": _("%(path)s cannot be read: %(problem)s."),
    },
)
