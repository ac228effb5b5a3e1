"""Sinumerik 840D: its texts are blocks of words like those of RS-274, with statements between them."""
