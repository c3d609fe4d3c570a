"""Frames with time stamps in, poses out, as fast as they come; and smoother ones afterwards."""
