"""Pictures, tags and embedded pages for links to the site that are shared elsewhere.

Rooms register each kind of page (:mod:`.registry`) with what a guest may see of it; :mod:`.drawing` draws the picture.
"""
