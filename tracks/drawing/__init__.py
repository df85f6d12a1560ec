"""Tracks as pictures: maps, prints at true size, and the cards of shared links."""
