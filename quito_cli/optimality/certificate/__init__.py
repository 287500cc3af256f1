"""The conditions judged, a row each."""
