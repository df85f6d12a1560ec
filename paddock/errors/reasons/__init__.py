"""Every reason code: one file for each place where something can be refused or fail."""

from . import (
    account,
    bodies,
    commands,
    conversion,
    duels,
    gate,
    jobs,
    league,
    metadata,
    platform,
    race,
    rivals,
    run_time,
    sb3,
    traces,
    tracks,
    training,
    upload,
    vehicles,
    videos,
)
from .reason import Reason, gettext_noop

REASONS: dict[str, Reason] = {
    **upload.REASONS,
    **metadata.REASONS,
    **conversion.REASONS,
    **sb3.REASONS,
    **gate.REASONS,
    **run_time.REASONS,
    **platform.REASONS,
    **tracks.REASONS,
    **traces.REASONS,
    **race.REASONS,
    **league.REASONS,
    **rivals.REASONS,
    **duels.REASONS,
    **account.REASONS,
    **bodies.REASONS,
    **vehicles.REASONS,
    **videos.REASONS,
    **training.REASONS,
    **jobs.REASONS,
    **commands.REASONS,
}

__all__ = ["REASONS", "Reason", "gettext_noop"]
