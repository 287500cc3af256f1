"""Answers of bundled problems, each derived from its own optimality conditions without quito."""
