"""Which motion tells most about the parameters (chapter, section 2.2.3)."""
