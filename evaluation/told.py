"""What a racer is told of an upload: what was taken of it and what was not needed, in sentences."""

from __future__ import annotations

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from paddock.packages.choose import BEST, LAST

from .admit import AdmittedPackage

_NAMED = 12  # files that a sentence names


def sentences(package: AdmittedPackage | None) -> list[str]:
    """In the reader's language; none for an upload that held the car and nothing else."""
    said: list[str] = []
    if package is None:
        return said
    if package.reason == BEST:
        said.append(_("Checkpoint used: %(file)s, the best by deepracer_checkpoints.json.") % {"file": package.taken})
    elif package.reason == LAST:
        said.append(_("Checkpoint used: %(file)s, the last of the training.") % {"file": package.taken})
    elif package.reason:
        said.append(_("Checkpoint used: %(file)s, as chosen.") % {"file": package.taken})
    if package.output:
        said.append(_("The network's output %(output)s drives the car.") % {"output": package.output})
    if package.ignored:
        names = ", ".join(package.ignored[:_NAMED]) + (", …" if len(package.ignored) > _NAMED else "")
        count = len(package.ignored)
        said.append(
            ngettext("%(count)d file ignored: %(names)s", "%(count)d files ignored: %(names)s", count)
            % {"count": count, "names": names}
        )
    return said
