"""The bounds on an upload, as this installation has set them."""

from __future__ import annotations

from dataclasses import replace

from django.conf import settings

from paddock.packages.limits import DEFAULT_LIMITS, MEGABYTE, PackageLimits


def package_limits() -> PackageLimits:
    """What :func:`.packages.admit.admit` is given, on the site and from the command line."""
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
