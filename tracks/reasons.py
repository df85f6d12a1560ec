"""Reason codes of tracks."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Races",
    invalid={
        # tracks that racers import
        "track_name": _("Give the track a name of 1 to %(limit)s characters on one line."),
        "track_look": _("Invalid look of a track. Choose one of: %(looks)s."),
        "track_slug": _(
            "The address %(slug)s cannot be used. Use lower-case letters, digits and hyphens; it must be new."
        ),
    },
    not_found={
        "track_shape_unknown": _(
            "The shape of %(name)s is unknown: only its name was imported, with the results of a season."
        ),
    },
    conflict={
        "track_known": _("This track already exists as %(name)s. Use that one."),
        "track_limit": _("You have reached the limit of %(limit)s imported tracks. Use one of them, or ask an admin."),
        "reference_undrivable": _(
            "No reference lap of this track could be driven without leaving the road. Race on it without medals, or "
            "import a wider track."
        ),
        "track_in_use": _("Races, runs or assignments use this track, so it stays."),
    },
    unavailable={
        "reference_lost": _("The worker that drove this reference lap disappeared. It will be driven again."),
        "reference_failed": _("Paddock failed to drive this reference lap. The worker's log has the details."),
    },
)

register(
    "Commands",
    invalid={
        "track_database": _(
            "There is no track %(name)s in the catalogue, and this site's tracks cannot be read: "
            "%(problem)s. Use a catalogue track (%(known)s) or an .npy file, or check the database."
        ),
    },
    not_found={
        "track_not_found": _(
            "There is no track %(name)s. The closest names are: %(nearest)s. Name an .npy file, a track that was "
            "imported into this site, or one of the catalogue: %(known)s."
        ),
    },
)
