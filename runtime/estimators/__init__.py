"""Estimators, one file a method; `runtime.compose` names them by name."""
