"""Seasons: planning, rounds, pages, API and succession."""
