"""Files for other tools: tables, labels, sound."""
