"""Sound files of the noise: signed signals, mixed so that their powers add."""
