"""As in English: one style of dates in every language."""

from config.formats.en.formats import *  # noqa: F403
