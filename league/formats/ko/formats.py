"""As in English: one style of dates in every language."""

from league.formats.en.formats import *  # noqa: F403
