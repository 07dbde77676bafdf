"""Fault localisation: stage of the control flow, onset, band, joints and links of a failure."""
