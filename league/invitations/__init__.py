"""Invitations to a race by e-mail."""
