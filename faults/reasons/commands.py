"""Why a management command refuses what was typed."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "command_line": _("The command line is not understood: %(problem)s. Call the command with --help."),
        "file_unreadable": _("%(path)s cannot be read: %(problem)s."),
        "track_not_found": _("There is no track %(name)s. Name an .npy file or one of: %(known)s."),
        "rules_senseless": _("These rules make no sense: %(problem)s."),
    },
)
