"""Cases solved, each in a process that may fail alone, here or on a cluster; the journal of it."""
