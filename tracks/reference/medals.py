"""Medals for laps, from the time of a track's reference lap. This is the one list of them."""

from django.db.models import TextChoices
from django.utils.translation import pgettext_lazy


class Medal(TextChoices):
    """The best first."""

    AUTHOR = "author", pgettext_lazy("medal", "Author")
    GOLD = "gold", pgettext_lazy("medal", "Gold")
    SILVER = "silver", pgettext_lazy("medal", "Silver")
    BRONZE = "bronze", pgettext_lazy("medal", "Bronze")


# The slowest lap, in per cent of the reference; the author's medal is for a lap that is faster than it.
PERCENT = {Medal.GOLD: 105, Medal.SILVER: 115, Medal.BRONZE: 130}


def medal_times(reference_ms: int) -> dict[Medal, int]:
    """The slowest lap of each medal in ms, the best medal first."""
    return {Medal.AUTHOR: reference_ms - 1} | {
        medal: reference_ms * percent // 100 for medal, percent in PERCENT.items()
    }


def medal_of(time_ms: int | None, reference_ms: int | None) -> Medal | None:
    """The medal of a lap; None where it is too slow, or either time is missing."""
    if time_ms is None or reference_ms is None:
        return None
    return next((medal for medal, slowest in medal_times(reference_ms).items() if time_ms <= slowest), None)


def next_medal(time_ms: int | None, reference_ms: int) -> tuple[Medal, int] | None:
    """The next better medal than that of a lap, and its slowest time; None above the best one."""
    times = medal_times(reference_ms)
    better = [(medal, slowest) for medal, slowest in times.items() if time_ms is None or slowest < time_ms]
    return better[-1] if better else None
