"""Other codes on the reference plaque, each in a file of its own; none knows this package."""
