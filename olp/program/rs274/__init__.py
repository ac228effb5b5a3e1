"""RS-274, ISO 6983 and similar: lexer, modal state, blocks to moves, canned cycles."""
