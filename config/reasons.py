"""Errors of the site's commands, database, streams and tokens."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    unavailable={
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
    invalid={
        "stream_topics": _("Unknown stream topic. Reload the page; a program names one to 32 topics."),
    },
    unauthorized={
        "stream_token": _("Invalid token, or one without the scope read."),
    },
    forbidden={
        "stream_refused": _("The stream is for pages of this site and for programs, which ask for it with GET."),
    },
    not_found={
        "stream_topic_hidden": _("One of the topics does not exist, or you have no access to it."),
    },
    too_many_requests={
        "streams_of_racer": _("You have as many pages open as the site allows. Close some."),
        "streams_of_address": _("As many pages as the site allows are open from your address. Close some."),
    },
)

register(
    "Programs",
    invalid={
        "wrong_credentials": _("Alias, e-mail address or password is wrong."),
        "wrong_code": _("The code is wrong or has already been used."),
        "no_token": _("Send the token to revoke in the header Authorization: Token ..."),
    },
    forbidden={
        "email_unverified": _("Verify your e-mail address first: follow the link in the message we sent you."),
        "sso_first_log_in": _("You have no account here yet. Log in on the site once to choose your alias."),
        "second_factor_needed": _(
            "Send the code of your second factor too. If you only have a passkey, create a token in "
            "the settings on the site."
        ),
    },
)

register(
    "Commands",
    invalid={
        "units_refused": _("No unit was written: %(problem)s."),
        "file_unwritable": _("%(path)s cannot be written: %(problem)s."),
        "backup_damaged": _("%(path)s cannot be restored: %(problem)s. Nothing was changed. Take another backup."),
        "backup_other_database": _(
            "The backup is a %(theirs)s database; this site uses %(ours)s. Set DATABASE_URL to an "
            "empty database of the backup's type."
        ),
        "backup_newer": _(
            "The backup is from a newer version of Paddock: it contains the unknown migration "
            "%(migration)s. Update the checkout first."
        ),
        "postgres_tools_missing": _(
            "PostgreSQL's %(tool)s, version %(version)s or newer, is not installed. Install it "
            "(Debian: postgresql-client-%(version)s)."
        ),
    },
    conflict={
        "backup_exists": _("%(path)s already exists and was not changed. Choose a new file name."),
        "restore_not_empty": _(
            "%(place)s is not empty; restoring would overwrite it. Use an empty database and an empty file store."
        ),
    },
)
