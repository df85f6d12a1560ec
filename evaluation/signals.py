"""Signals to the rooms above."""

from django.dispatch import Signal

evaluation_ended = Signal()
"""Sent inside the transaction that makes an evaluation final, so that a receiver's writes stand or fall with it.

kwargs: ``evaluation`` (fresh from the database), ``result`` (a Result, or None unless it finished), ``now``.
Of a sealed run it is sent twice: when it was computed (``evaluation.sealed``: nothing of it may be shown yet), and when
it is unsealed.
A receiver that raises undoes the end: the evaluation is then tried again.
"""

model_deleted = Signal()
"""Sent inside the transaction that takes a model out of its owner's garage. kwargs: ``model``, ``now``."""
