"""How coarse may an encoder be? Predicted, not sampled."""
