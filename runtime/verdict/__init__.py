"""The verdict on an identification: its questions, asked of one result, and what the answers come to."""
