"""Signals of accounts to the rooms above."""

from django.dispatch import Signal

# racer: their address was never verified, and its owner has now reset the password. Sent in the transaction.
account_taken_over = Signal()
