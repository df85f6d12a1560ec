"""The HTTP API as a whole: who asks, its schema and reference, its addresses.

Rooms below never import this package; Django REST framework finds it through its settings.
"""
