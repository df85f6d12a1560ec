"""Queries of entries and races: lists, terms, offers and visibility."""
