"""Joint motion estimated from encoder counts, each of which bounds the position."""
