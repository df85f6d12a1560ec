"""Ranking methods, board counts and boards."""
