"""Signals of this room for higher rooms."""

from django.dispatch import Signal

# Sent inside the transaction that changed who stands on the board of a race other than by racing: an entry was removed
# or restored. Arguments: ``race``, ``now``.
board_changed = Signal()
