"""Friction against velocity, joint by joint, and the law that it follows."""
