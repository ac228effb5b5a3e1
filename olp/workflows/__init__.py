"""The session, and one file a verb: files in, result out."""
