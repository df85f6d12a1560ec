"""The table of marks, and regrades."""
