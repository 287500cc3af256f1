"""Refinement: solve, look at the answer, move the mesh, carry the answer over, solve again.

`refine` is the loop, `monitor` says how long the cells should be, `grading` makes a mesh of that,
`account` estimates the error of what came out.
"""
