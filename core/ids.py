"""Public ids, which addresses contain instead of primary keys."""

from django.utils.crypto import get_random_string

ALPHABET = "23456789abcdefghjkmnpqrstuvwxyz"  # no look-alikes: these get read aloud and typed


def new_public_id() -> str:
    """Twelve random letters and digits (59 bits)."""
    return get_random_string(12, ALPHABET)
