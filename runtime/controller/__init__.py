"""Joint torques computed by the control law, for records that contain no measured torque."""
