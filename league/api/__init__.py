"""The HTTP API: what every room's ``api.py`` shares (errors, tokens, pages, limits, schema), and where it is joined.

Rooms below never import this package; Django REST framework finds it through its settings.
"""
