"""Assignments: make, change, publish, copy and delete them; extensions and submission groups."""
