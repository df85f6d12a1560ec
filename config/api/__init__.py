"""The HTTP API as a whole: authentication, its schema and reference, its addresses. Rooms below never import it."""
