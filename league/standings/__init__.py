"""Standings, divisions, fields of finales and ratings."""
