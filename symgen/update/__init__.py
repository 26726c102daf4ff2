"""Write identified values back into the URDF or MJCF file from which a robot was read."""
