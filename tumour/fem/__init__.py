"""The two-dimensional elastic tumour with MINI elements."""
