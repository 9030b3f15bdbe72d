"""Methods beside the finite elements: gravity method, limit analysis, verdict of a run; and
sentences on a case and its run: notes, hints, statement.
"""
