"""Reward functions: a stranger's Python, which runs in the sandbox only. Nothing here imports Django.

Inside the sandbox: :mod:`.function` (load and call), :mod:`.watch` (its time and its prints), :mod:`.modules` (what it
may import), :mod:`.check` (help before it runs), :mod:`.process`. Outside: :mod:`.validate` and :mod:`.laboratory`.
"""

from . import reasons as reasons  # registers its codes
