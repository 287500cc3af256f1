"""One problem solved over a grid of values, as a table and an HDF5."""
