"""From measured files to a `Record`: joint side, SI, uniform time."""
