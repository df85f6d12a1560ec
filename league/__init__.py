"""The league: seasons, rounds, divisions, promotion, standings."""
