"""Webhooks: signed messages to racers' programs."""
