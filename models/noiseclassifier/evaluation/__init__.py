"""Evaluation of a classifier: whole runs, frames, intervals over groups of runs.

    run -> predictions -> outcome (`matching`) -> protocol, frames (`measures`) -> `assessment`

Nothing here is trained: `matching` calls the classifier, the rest counts.
"""
