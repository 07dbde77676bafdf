"""Verdicts and reports: Markdown, HTML, and the formats of `classify`."""
