"""Analysis of a run: labels, findings, audit, status."""
