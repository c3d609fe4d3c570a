"""How an image comes about: beam profile, light on the wall, noise, what hides it; and least squares on it."""
