"""Line-oriented languages of motion that a file describes."""
