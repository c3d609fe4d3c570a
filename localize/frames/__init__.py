"""Frames from outside: files, folders and videos that somebody's camera made, as the scene's sensor would give them."""
