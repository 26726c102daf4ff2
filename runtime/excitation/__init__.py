"""Search for the motion that determines the parameters best (chapter, section 2.2.3)."""
