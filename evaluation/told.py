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
        said.append(_("Taken: %(file)s, the best by deepracer_checkpoints.json.") % {"file": package.taken})
    elif package.reason == LAST:
        said.append(_("Taken: %(file)s, the last one of the training.") % {"file": package.taken})
    elif package.reason:
        said.append(_("Taken: %(file)s, as you chose.") % {"file": package.taken})
    if package.output:
        said.append(_("Of the network's outputs, %(output)s is what drives.") % {"output": package.output})
    if package.ignored:
        names = ", ".join(package.ignored[:_NAMED]) + (", …" if len(package.ignored) > _NAMED else "")
        count = len(package.ignored)
        said.append(
            ngettext("%(count)d file was not needed: %(names)s", "%(count)d files were not needed: %(names)s", count)
            % {"count": count, "names": names}
        )
    return said
