"""The API of races of real cars."""
