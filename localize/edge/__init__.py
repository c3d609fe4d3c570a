"""The patch's edge, found below the pixel in bands along its predicted outline."""
