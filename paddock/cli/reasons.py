"""Why the command at home cannot do what it was asked."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "At home",
    "user",
    {
        "home_command_line": _("Invalid command line: %(problem)s. Run the command with --help."),
        "home_file_unreadable": _("%(path)s cannot be read: %(problem)s."),
        "home_file_unwritable": _("%(path)s cannot be written: %(problem)s."),
        "home_exists": _("%(path)s is there already, and nothing is overwritten. Name another place."),
        "site_missing": _(
            "No site is named. Say paddock login URL once, set PADDOCK_SITE, or give the option --site URL."
        ),
        "site_address": _(
            "%(address)s is no address of a site. It must begin with https:// or http:// and name a host."
        ),
        "site_is_no_paddock": _(
            "%(site)s answers, but it is no Paddock (%(problem)s). Check the address, without /api and without a page."
        ),
        "site_elsewhere": _(
            "%(site)s sends everything on to %(there)s. Nothing was sent there: name that address, if you trust it."
        ),
        "token_missing": _("This needs your token. Say paddock login %(site)s, or set PADDOCK_TOKEN."),
        "token_refused": _(
            "%(site)s does not know this token: it has expired, was revoked, or belongs to another site. Say "
            "paddock login %(site)s again."
        ),
        "not_on_site": _("%(site)s has nothing at %(what)s, or does not show it to you. Check the address."),
        "race_wanted": _("%(given)s names no race. Give the address of its page, or the last part of that."),
        "result_wanted": _("%(given)s names no result. Give the address of its page, or its id."),
        "result_not_there": _("There is nothing to compare with: this run is %(state)s and has no result."),
        "engine_differs": _(
            "The result is of the engine %(theirs)s, and this package drives with %(ours)s. Two engines are not "
            "compared: install the package of that engine."
        ),
        "track_differs": _(
            "The track %(track)s is not the one that the run was driven on. The site's points do not fit its own "
            "fingerprint, so nothing was driven."
        ),
        "rules_unknown": _(
            "This package does not know the rules of that race (%(problem)s). Install the one of the site's version."
        ),
        "trace_strange": _("The trace of that run cannot be read (%(problem)s)."),
        "rule_senseless": _("Invalid rules: %(problem)s."),
        "track_unknown": _(
            "There is no track %(name)s here. The closest names are: %(nearest)s. Or name an .npy file."
        ),
    },
)

register(
    "At home",
    "platform",
    {
        "site_unreachable": _("%(site)s cannot be reached: %(problem)s. Check your network and the address."),
        "site_broken": _("%(site)s failed (%(problem)s). Nothing is wrong with what you sent; try again later."),
        "wait_over": _("The run has not ended within %(seconds)s s. It goes on without you: %(url)s"),
        "drive_failed": _("The process that drives ended without a result (%(problem)s)."),
    },
)
