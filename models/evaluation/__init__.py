"""Honest measuring of a classifier: whole runs, events, intervals over groups of runs.

    run -> heard -> matching -> frames and events -> intervals -> assessment -> table

Nothing here learns. `heard` asks the classifier, the rest counts.
"""
