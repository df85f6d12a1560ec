"""Reason codes of the command."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "At home",
    invalid={
        "home_command_line": _("Invalid command line: %(problem)s. Run the command with --help."),
        "home_file_unreadable": _("%(path)s cannot be read: %(problem)s."),
        "home_file_unwritable": _("%(path)s cannot be written: %(problem)s."),
        "home_folder_empty": _(
            "%(path)s contains no model: no archive, no ONNX file, and no network with its model_metadata.json."
        ),
        "home_folder_large": _("%(path)s contains too many or too large files. Name a smaller folder."),
        "home_not_confirmed": _("Not confirmed, so nothing was changed. Add --yes to confirm."),
        "site_missing": _("No site given. Run paddock login URL once, set PADDOCK_SITE, or use the option --site URL."),
        "site_address": _("%(address)s is not a site address. Use https:// or http:// and a host name."),
        "site_is_no_paddock": _(
            "%(site)s responds but is not a Paddock site (%(problem)s). Check the address: no /api, no page path."
        ),
        "site_elsewhere": _(
            "%(site)s redirects to %(there)s. Nothing was sent there. Use that address if you trust it."
        ),
        "race_wanted": _("%(given)s is not a race. Use the address of its page, or the last part of it."),
        "result_wanted": _("%(given)s is not a result. Use the address of its page, or its id."),
        "engine_differs": _(
            "The result is from the engine %(theirs)s; this package uses %(ours)s. Results of "
            "different engines cannot be compared. Install the matching package."
        ),
        "track_differs": _(
            "The track %(track)s differs from the track of the run: the site's points do not match "
            "its fingerprint. Nothing was run."
        ),
        "rules_unknown": _(
            "This package does not support the rules of that race (%(problem)s). Install the package "
            "of the site's version."
        ),
        "trace_strange": _("The trace of that run cannot be read (%(problem)s)."),
        "rule_senseless": _("Invalid rules: %(problem)s."),
    },
    unauthorized={
        "token_missing": _("A token is required. Run paddock login %(site)s, or set PADDOCK_TOKEN."),
        "token_refused": _(
            "%(site)s rejected this token: it has expired, was revoked, or belongs to another site. "
            "Run paddock login %(site)s again."
        ),
    },
    not_found={
        "home_model_unknown": _("%(name)s is no model of your garage: use its id, its address or its exact name."),
        "not_on_site": _("%(what)s does not exist on %(site)s, or you have no access. Check the address."),
        "track_unknown": _(
            "There is no track %(name)s here. The closest names are: %(nearest)s. Or name an .npy file."
        ),
    },
    conflict={
        "home_exists": _("%(path)s already exists and was not overwritten. Choose another path."),
        "result_not_there": _("This run has no result to compare with (state: %(state)s)."),
    },
    unavailable={
        "site_unreachable": _("%(site)s cannot be reached: %(problem)s. Check your network and the address."),
        "site_broken": _("Error on %(site)s (%(problem)s). Your request was fine. Try again later."),
        "wait_over": _("The run is not finished after %(seconds)s s. It continues on the site: %(url)s"),
        "drive_failed": _("The simulator process ended without a result (%(problem)s)."),
    },
)
