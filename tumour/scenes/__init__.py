"""Scene files that ship with the tumour."""
