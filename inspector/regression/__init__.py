"""Runs before and after a change of code: pairing, levels, the statistic, verdicts, output."""
