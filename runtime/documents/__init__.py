"""Reading and writing of study files and results, in YAML and JSON, within limits of size."""
