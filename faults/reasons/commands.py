"""Why a management command refuses what was typed."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "command_line": _("The command line is not understood: %(problem)s. Call the command with --help."),
        "file_unreadable": _("%(path)s cannot be read: %(problem)s."),
        "track_not_found": _(
            "There is no track %(name)s. The closest names are: %(nearest)s. Name an .npy file, a track that was "
            "imported into this site, or one of the catalogue: %(known)s."
        ),
        "track_database": _(
            "There is no track %(name)s in the catalogue, and this site's own tracks cannot be looked up: %(problem)s. "
            "Name one of the catalogue (%(known)s) or an .npy file, or see to the database."
        ),
        "rules_senseless": _("These rules make no sense: %(problem)s."),
    },
)
