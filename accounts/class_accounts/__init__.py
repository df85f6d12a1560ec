"""Accounts of a class: made by a teacher, logged in by codes."""
