"""Who may sign up: everybody, who holds an invitation of an admin, or nobody (PADDOCK_SIGN_UP)."""

from __future__ import annotations

OPEN, INVITATION, CLOSED = "open", "invitation", "closed"
MODES = (OPEN, INVITATION, CLOSED)

# Where a visitor's session keeps the code of the invitation whose link was followed.
CODE = "sign_up_invitation"
