"""From a good answer to an exact one: the structure that an answer shows, solved as a boundary
value problem of Pontryagin's conditions.

`polish` is the entry; it decides what stands. The folders in the order of the pipeline:

    equations   setting     Pontryagin's system with its parts, derived once for a problem
                structure   phases between junctions, and what can be done to them
                law         controls, multipliers and flow of a phase, pointwise
                junctions   what holds at junctions
                leaps       what costates jump by
                ends        what holds at the ends of the horizon
                gauss       the collocation that integrates
                unknowns    what is solved for, and where each is
                system      all of these for a structure: the equations

    reading     direct      trajectories and multipliers of a direct answer, of indirect adjoining
                shown       the structure that it shows
                told        the structure in a sentence
                ends_held   which ends of ranges hold

    solving     start       unknowns to start from: of `direct`, or of what was solved before
                again       (another structure, solved)
                pointwise   functions and linear systems at many points
                flow        a phase's equations linearised, its Gauss points eliminated
                rows        equations at nodes: rows_at_junctions, rows_at_points, rows_at_ends
                assembly    all equations about a point, as a chain
                chain       least squares of a chain
                newton      damped Gauss-Newton
                refine      segments halved until their polynomials carry

    faults      dense       what was solved as functions of time
                adjoining   its multipliers of direct adjoining
                fault       an inequality that does not hold
                faults      all of them: faults_of_controls, faults_of_rows, faults_of_curvature,
                            faults_of_formulas, minimum, limits
                lengths     whether brief arcs are there
                focal       whether the extremal is isolated

    search      attempts    what a search is made of
                parting     junctions at which several things change, taken apart
                revise      the structure that a fault asks for
                mending     what to try after a structure that does not fit
                search      solved, looked at, revised, until nothing is wrong

    answer      exact       an extremal as polynomials
                written     what was solved as one
                answer      an extremal as an answer like any other: multipliers, switches
"""
