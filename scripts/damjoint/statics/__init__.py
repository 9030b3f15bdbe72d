"""Methods beside the finite elements: gravity method, limit analysis, verdict of a run; and what is
said of a case and its run: notes, hints, statement.
"""
