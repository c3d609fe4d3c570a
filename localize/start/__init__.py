"""Where a fit begins: rings of light found in an overview of the image, without a guess."""
