"""Cups of the day: their rules, driving, pages and API."""
