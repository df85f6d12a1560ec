"""Standings and outcomes of rounds for reading."""
