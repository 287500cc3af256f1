"""Pontryagin's conditions, derived from the Model by CasADi.

One convention everywhere, that of quito's costates: the problem is a minimisation (a file that
maximises J minimises −J), λ = ∂V/∂x, and

    H(x, λ, u, p, t, ν) = L + λᵀf + νᵀq,                  q the integrands of integral constraints,
    λ' = −(H + μᵀc)_x,   (H + μᵀc)_u = 0 where u is free, c the rows that bound x and u together,

so that the control minimises H. Multipliers of whatever is bounded, lower ≤ c ≤ upper, are ≥ 0
where c is at its upper bound, ≤ 0 at its lower one, and 0 between; those of equalities have any
sign. The normal case is taken: the cost's own multiplier is 1. (A. E. Bryson and Y.-C. Ho, Applied
Optimal Control, 1975, chapters 2, 3 and 8; R. F. Hartl, S. P. Sethi and R. G. Vickson, SIAM Review
37 (1995), for constraints of state and control.)

What is derived of a problem: `hamiltonian`, `singular`, `constraints`, `transversality`, worked out
by `symbols` and written out by `page`. An answer is looked at (`looking`), judged (`certificate`)
and made exact (`polish`); controls with kinks in H are taken apart first (`parts`).
"""

from quito_cli.optimality.hamiltonian import Pontryagin, pontryagin

__all__ = ["Pontryagin", "pontryagin"]
