"""Stored files: whole writes, byte ranges, archives, private folders, faults of a storage."""
