"""An application whose second migration breaks the code before it."""
