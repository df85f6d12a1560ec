"""Queries of live events for pages, streams and the API."""
