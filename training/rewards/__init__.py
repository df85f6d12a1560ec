"""Reward functions: a racer's Python, which runs in the sandbox only.

:mod:`.sandbox` loads, checks and calls them in a locked process. :mod:`.validation` tries one in five states, and
:mod:`.laboratory` shows the rewards along a lap.
"""

from . import reasons as reasons  # registers its codes
