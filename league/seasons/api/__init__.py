"""Seasons in the HTTP API."""
