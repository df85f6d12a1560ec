"""The limits of an upload, and its summary. No models: commands use it without the apps."""

from dataclasses import replace

from django.conf import settings
from django.utils.translation import gettext, ngettext

from paddock.packages.choose import BEST, LAST
from paddock.packages.limits import DEFAULT_LIMITS, MEGABYTE, PackageLimits

from .admission import AdmittedPackage

_NAMED = 12  # files that a sentence names


def package_limits() -> PackageLimits:
    million = 1_000_000
    return replace(
        DEFAULT_LIMITS,
        upload_bytes=settings.UPLOAD_LIMIT_MB * MEGABYTE,
        model_bytes=settings.NETWORK_LIMIT_MB * MEGABYTE,
        expanded_bytes=settings.UNPACKED_LIMIT_MB * MEGABYTE,
        archive_members=settings.ARCHIVE_FILES,
        tensor_elements=settings.NETWORK_LAYER_MILLIONS * million,
        macs=settings.NETWORK_MULTIPLICATIONS_MILLIONS * million,
        elements=settings.NETWORK_VALUES_MILLIONS * million,
        nodes=settings.NETWORK_OPERATORS,
        slots=settings.UPLOADS_AT_ONCE,
        slot_wait_s=settings.UPLOAD_WAIT_SECONDS,
    )


def upload_summary(package: AdmittedPackage | None) -> list[str]:
    """Sentences on the chosen checkpoint, the output and the ignored files of an upload."""
    lines: list[str] = []
    if package is None:
        return lines
    if package.reason == BEST:
        lines.append(
            gettext("Checkpoint used: %(file)s, the best by deepracer_checkpoints.json.") % {"file": package.taken}
        )
    elif package.reason == LAST:
        lines.append(gettext("Checkpoint used: %(file)s, the last of the training.") % {"file": package.taken})
    elif package.reason:
        lines.append(gettext("Checkpoint used: %(file)s, as chosen.") % {"file": package.taken})
    if package.output:
        lines.append(gettext("The network's output %(output)s drives the car.") % {"output": package.output})
    if package.ignored:
        names = ", ".join(package.ignored[:_NAMED]) + (", …" if len(package.ignored) > _NAMED else "")
        count = len(package.ignored)
        lines.append(
            ngettext("%(count)d file ignored: %(names)s", "%(count)d files ignored: %(names)s", count)
            % {"count": count, "names": names}
        )
    return lines
