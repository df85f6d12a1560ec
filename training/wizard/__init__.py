"""The wizard "Create a model": its form, proposals and views."""
