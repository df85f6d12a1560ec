"""Vehicles of the garage: services, form, pages, API."""
