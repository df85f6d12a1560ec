"""Work after a commit, whose failure is logged and goes no further."""

from collections.abc import Callable
from functools import wraps

from django.db import transaction


def after_commit(work: Callable[..., object], *arguments: object, **options: object) -> None:
    """Call ``work`` once the present transaction is through; what it raises is logged.

    Django logs such a call by its ``__qualname__``, which a ``functools.partial`` lacks: its failure would be raised.
    """
    transaction.on_commit(wraps(work)(lambda: work(*arguments, **options)), robust=True)
