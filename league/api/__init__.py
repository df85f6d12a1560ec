"""The league in the HTTP API."""
