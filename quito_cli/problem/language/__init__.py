"""Formulas: text -> tokens -> checked syntax tree -> CasADi SX."""
