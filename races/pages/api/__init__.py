"""The API of races: finding, organising, entering and reading boards."""
