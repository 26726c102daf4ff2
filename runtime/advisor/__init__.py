"""Predict how coarse an encoder may be before the estimated parameters are biased."""
