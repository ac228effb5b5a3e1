"""Text to moves and back, lossless: dialects, their readers, and which word holds which coordinate."""
