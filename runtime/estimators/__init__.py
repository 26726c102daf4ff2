"""Estimators, one file a method; `runtime.estimators.methods` finds them by name."""
