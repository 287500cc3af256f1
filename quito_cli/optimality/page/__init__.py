"""The page of `quito show --pontryagin`: the conditions of a problem, written out."""
