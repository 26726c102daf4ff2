"""Estimators, one file a method; `runtime.loop.methods` finds them by name."""
