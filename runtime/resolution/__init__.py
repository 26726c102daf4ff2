"""Encoder resolution: CESTAC (chapter, section 3) and the advisor."""
