"""What is said of an answer, in words: the same on a terminal, on a page and in a report."""
