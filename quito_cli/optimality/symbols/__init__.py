"""Formulas worked on: sums with exact numbers; zero or not by numbers, where those end."""
