"""The whole patch, with the retina's albedo as a random field."""
