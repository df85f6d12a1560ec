"""Why a management command refuses, and what fails below it."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    "platform",
    {
        "database_not_ready": _(
            "The database is not ready: %(problem)s. Run “manage.py migrate” (“manage.py run” does "
            "this automatically), or check DATABASE_URL and PADDOCK_DATA."
        ),
        "database_damaged": _(
            "The database is damaged: %(problem)s. Restore the last good backup (“manage.py restore”) into an empty "
            "place."
        ),
        "database_tool_failed": _("%(tool)s failed: %(problem)s."),
        "streams_full": _("Too many live pages are open. This page updates by polling; try again later."),
        "streams_away": _("The stream is not available now. This page updates by polling; try again later."),
    },
)

register(
    "The stream",
    "user",
    {
        "stream_topics": _("Unknown stream topic. Reload the page."),
        "stream_refused": _("The stream is for pages of this site, which ask for it with GET."),
        "streams_of_racer": _("You have as many pages open as the site allows. Close some."),
        "streams_of_address": _("As many pages as the site allows are open from your address. Close some."),
    },
)

register(
    "Commands",
    "user",
    {
        "command_line": _("Invalid command line: %(problem)s. Run the command with --help."),
        "file_unreadable": _("%(path)s cannot be read: %(problem)s."),
        "file_unwritable": _("%(path)s cannot be written: %(problem)s."),
        "backup_exists": _("%(path)s already exists and was not changed. Choose a new file name."),
        "backup_damaged": _("%(path)s cannot be restored: %(problem)s. Nothing was changed. Take another backup."),
        "backup_other_database": _(
            "The backup is a %(theirs)s database; this site uses %(ours)s. Set DATABASE_URL to an "
            "empty database of the backup's type."
        ),
        "backup_newer": _(
            "The backup is from a newer version of Paddock: it contains the unknown migration "
            "%(migration)s. Update the checkout first."
        ),
        "restore_not_empty": _(
            "%(place)s is not empty; restoring would overwrite it. Use an empty database and an empty file store."
        ),
        "site_from_before": _(
            "The database is from a version before 0.1.0. Move it aside and copy it into a new one "
            "with manage.py carry_over. Nothing was changed."
        ),
        "carry_unreadable": _("%(path)s cannot be read as a database: %(problem)s."),
        "carry_other_kind": _(
            "The old database is %(theirs)s; this site uses %(ours)s. Set DATABASE_URL to an empty "
            "database of the same type."
        ),
        "carry_other_state": _(
            "%(path)s does not have the schema of the last version before 0.1.0 (%(found)s). Start "
            "that version once to migrate it. Nothing was changed."
        ),
        "carry_not_empty": _("The site's database already has racers. Use an empty one."),
        "postgres_tools_missing": _(
            "PostgreSQL's %(tool)s, version %(version)s or newer, is not installed. Install it "
            "(Debian: postgresql-client-%(version)s)."
        ),
        "track_not_found": _(
            "There is no track %(name)s. The closest names are: %(nearest)s. Name an .npy file, a track that was "
            "imported into this site, or one of the catalogue: %(known)s."
        ),
        "track_database": _(
            "There is no track %(name)s in the catalogue, and this site's tracks cannot be read: "
            "%(problem)s. Use a catalogue track (%(known)s) or an .npy file, or check the database."
        ),
        "race_not_found": _(
            "There is no race %(name)s on this site. The closest names are: %(nearest)s. Use the "
            "address of its page, or the last part of it."
        ),
        "rules_senseless": _("Invalid rules: %(problem)s."),
    },
)
