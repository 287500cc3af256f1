"""Many solves: suites with expectations, sweeps, baselines, reports.

`running` is the entry. In the order of the pipeline:

    suite    a file -> Suite: its cases, each with what is expected of it
    workers  cases -> Finished cases: one process each that may fail alone, and the journal
    judging  what was found held against what is expected, and against an earlier run
    reports  what became of it -> Report; and that as JUnit, Markdown, HTML, JSON, a table
    sweeps   one problem over a grid of values -> a table, an HDF5
"""
