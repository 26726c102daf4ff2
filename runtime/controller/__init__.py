"""Torque computed by the law of the controller, for records without a measured torque."""
