"""Notices to racers, in the site and by e-mail."""
