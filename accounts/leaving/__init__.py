"""Deleting an account: what goes, what stays without a name, and what prevents it."""
