"""The main job of the chapter end to end: the Staubli TX40 beside its published tables."""
