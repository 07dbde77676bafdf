"""Evaluation of a classifier: whole runs, events, intervals over groups of runs.

    run -> predictions -> matching -> frames and events -> intervals -> assessment -> table

Nothing here is trained: `predictions` calls the classifier, the rest counts.
"""
