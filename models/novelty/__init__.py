"""Novelty: learnt from good runs alone, how far a frame is from them."""
