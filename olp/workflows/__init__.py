"""The session, and one module per verb: files in, result out."""
