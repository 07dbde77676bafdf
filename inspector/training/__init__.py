"""Models learnt and measured from files: training, baselines, tuning, evaluation."""
