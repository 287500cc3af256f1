"""Rows of the table: solvers that CasADi knows and does not bring.

Their options are from their manuals; none of these could be tried.
"""

from __future__ import annotations

from quito_cli.solvers.backend import Backend

ROWS = (
    Backend(
        "knitro",
        "interior point and active set",
        "NLP",
        "nlpsol",
        "knitro",
        "Pardiso, MA57",
        "an installation of Artelys Knitro with its licence",
        group="knitro",
        tolerances=("opttol", "feastol"),
        iterations="maxit",
        fixed={"outlev": 0},
        isolated=True,
    ),
    Backend(
        "snopt",
        "sequential quadratic programming with reduced Hessians",
        "NLP",
        "nlpsol",
        "snopt",
        "sparse LU; quasi-Newton",
        "an installation of SNOPT 7 with its licence",
        group="snopt",
        tolerances=("Major optimality tolerance", "Major feasibility tolerance"),
        iterations="Major iterations limit",
        isolated=True,
    ),
    Backend(
        "worhp",
        "sequential quadratic programming",
        "NLP",
        "nlpsol",
        "worhp",
        "MA97",
        "an installation of WORHP with its licence",
        group="worhp",
        tolerances=("TolOpti", "TolFeas"),
        iterations="MaxIter",
        fixed={"NLPprint": -1},
        isolated=True,
    ),
    Backend(
        "madnlp",
        "interior point with a filter, in Julia",
        "NLP",
        "nlpsol",
        "madnlp",
        "mumps",
        "CasADi built with MadNLP (WITH_MADNLP)",
        group="madnlp",
        tolerances=("tol",),
        iterations="max_iter",
        isolated=True,
    ),
    Backend(
        "conopt",
        "generalised reduced gradients",
        "NLP",
        "nlpsol",
        "conopt",
        "sparse LU",
        "an installation of CONOPT 4 with its licence",
        group="conopt",
        iterations="Lim_Iteration",
        isolated=True,
    ),
)
