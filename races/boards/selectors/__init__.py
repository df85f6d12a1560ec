"""Boards of races, ranks on them and results of finished runs."""
