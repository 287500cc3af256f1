"""Structures tried: solved, looked at, revised, until nothing is wrong."""
