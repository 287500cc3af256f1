"""What `solve` is made of: an answer on one mesh, on many, and what follows an answer."""
