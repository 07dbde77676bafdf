"""Logs of robots, from where people have them: a reader per format, then one way to a run."""
