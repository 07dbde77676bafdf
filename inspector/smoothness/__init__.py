"""How smooth the motion of an episode is: measures, scores, ranking, table and picture."""
