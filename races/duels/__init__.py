"""Races of models against models: who meets whom, what a duel is worth, how a season rates.

Plain functions of plain values, without Django: a car is its seed, 1 for the best of qualifying. What is kept in the
database is written by ``races.services.duels`` and read by ``races.selectors.duels``.
"""
