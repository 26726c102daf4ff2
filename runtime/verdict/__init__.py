"""The verdict on an identification: its questions, and the overall result of their answers."""
