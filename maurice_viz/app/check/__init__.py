"""The parts of `check`: demands on many runs of a filter, and what is written about them.

rules    which demands hold, in how many runs, and whether that is worse than an earlier check
failure  the run that failed first: why, and a recording of the steps around
drive    all runs over one drive, judged
check    all drives, and the result as JUnit XML
"""
