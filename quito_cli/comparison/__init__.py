"""A solution against a reference or another: error norms, spectra, tables."""
