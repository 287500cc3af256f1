"""Model -> Nlp: the quasi-interpolated control, schemes, and mapped terms."""
