"""Fails before it is locked."""

raise ImportError("nothing here")
